"""Steps units: sessions over fmpy's low-level functions, their saved states, and whole runs.

It opens FMUs by baryscope.fmu.layout and needs nothing of baryscope.fmu.generate.
"""

from baryscope.fmu.runtime.session import Session, UnitError
from baryscope.fmu.runtime.simulation import Recording, simulate
from baryscope.fmu.runtime.state import SavedState

__all__ = ["Recording", "SavedState", "Session", "UnitError", "simulate"]
