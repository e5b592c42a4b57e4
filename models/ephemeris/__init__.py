"""Where the target is at a time: under J2, by SGP4 or from a table; and the files that tell: TLE, OMM and OEM.

`target_states` of `trajectory` gives position and velocity on any orbit. `orbit_of_message` recognises a file's form:
two-line elements (TLE) and orbit mean-elements messages (OMM) are propagated by SGP4, orbit ephemeris messages (OEM)
are interpolated. The forms are those of CCSDS 502.0-B. `runge_kutta` integrates orbits, and rotations elsewhere.
"""

from baryscope.models.ephemeris.elements import elements_of
from baryscope.models.ephemeris.messages import MAX_BYTES, OLDEST, orbit_of_message

__all__ = ["MAX_BYTES", "OLDEST", "elements_of", "orbit_of_message"]
