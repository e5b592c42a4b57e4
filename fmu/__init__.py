"""The co-simulation unit: CasADi's C code with a C adapter as an FMU, and a session to step it from Python."""

from baryscope.fmu.build import build_fmu
from baryscope.fmu.session import Recording, Session, simulate

__all__ = ["Recording", "Session", "build_fmu", "simulate"]
