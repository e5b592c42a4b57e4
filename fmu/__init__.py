"""The co-simulation unit: CasADi's C code with a C adapter as an FMU, and a session that steps it from Python.

Rooms: layout (files and value references of a unit), generate (builds units), runtime (steps them), check (checks
anybody's FMU), csrc (the C code of the adapter). generate, runtime and check import layout and not each other.
"""

from baryscope.fmu.generate import build_fmu
from baryscope.fmu.runtime import Recording, SavedState, Session, simulate

__all__ = ["Recording", "SavedState", "Session", "build_fmu", "simulate"]
