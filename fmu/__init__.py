"""The co-simulation unit: CasADi's C code with a C adapter as an FMU, and a session to step it from Python.

Rooms: layout (how a unit's file looks), generate (what makes one), runtime (what steps one), check (what doubts one),
and csrc, the C code of the adapter. The last three rooms of Python import layout, and not each other.
"""

from baryscope.fmu.generate import build_fmu
from baryscope.fmu.runtime import Recording, SavedState, Session, simulate

__all__ = ["Recording", "SavedState", "Session", "build_fmu", "simulate"]
