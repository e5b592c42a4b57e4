"""The co-simulation unit: CasADi's C code with a C adapter as an FMU, and a session to step it from Python."""

from baryscope.fmu.build import build_fmu
from baryscope.fmu.session import Session
from baryscope.fmu.simulation import Recording, simulate
from baryscope.fmu.state import SavedState

__all__ = ["Recording", "SavedState", "Session", "build_fmu", "simulate"]
