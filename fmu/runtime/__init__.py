"""What steps a unit: sessions over fmpy's low-level functions, their saved states, and whole runs.

It opens FMU files of ours by baryscope.fmu.layout, and does not care how they were made.
"""

from baryscope.fmu.runtime.session import Session, UnitError
from baryscope.fmu.runtime.simulation import Recording, simulate
from baryscope.fmu.runtime.state import SavedState

__all__ = ["Recording", "SavedState", "Session", "UnitError", "simulate"]
