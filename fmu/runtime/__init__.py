"""Steps units: sessions over fmpy's low-level functions, their saved states, and whole runs.

It opens FMUs by baryscope.fmu.layout and the tables of baryscope.fmu.units; it needs nothing of generate.
"""

from baryscope.fmu.runtime.session import Session, UnitError
from baryscope.fmu.runtime.simulation import Recording, simulate
from baryscope.fmu.runtime.state import SavedState
from baryscope.fmu.runtime.unit_session import UnitSession

__all__ = ["Recording", "SavedState", "Session", "UnitError", "UnitSession", "simulate"]
