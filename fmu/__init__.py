"""The co-simulation units: CasADi's C code with a C shell as FMUs, and sessions that step them from Python.

Rooms: layout (files and value references of a unit), units (what tells one from another), generate (builds them),
runtime (steps them), check (checks anybody's FMU), csrc (the C code of shell and units). generate, runtime and check
import layout and units and not each other.
"""

from baryscope.fmu.generate import build_fmu
from baryscope.fmu.runtime import Recording, SavedState, Session, UnitSession, simulate

__all__ = ["Recording", "SavedState", "Session", "UnitSession", "build_fmu", "simulate"]
