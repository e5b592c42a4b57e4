"""Orbits of the Earth's satellites from the files in which they are exchanged: TLE, OMM and OEM.

`orbit_of_message` recognises the form. Two-line elements (TLE) and orbit mean-elements messages (OMM) are propagated
by SGP4, orbit ephemeris messages (OEM) are interpolated. The forms are those of CCSDS 502.0-B.
"""

from baryscope.models.ephemeris.elements import elements_of
from baryscope.models.ephemeris.messages import MAX_BYTES, orbit_of_message

__all__ = ["MAX_BYTES", "elements_of", "orbit_of_message"]
