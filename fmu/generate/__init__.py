"""What makes a unit: C code from CasADi, modelDescription.xml, the compiler and its cache, and the packed FMU.

It writes what baryscope.fmu.layout describes, and the hand-written half of the C code lies in csrc/.
"""

from baryscope.fmu.generate.build import build_fmu
from baryscope.fmu.generate.compiler import find_compiler
from baryscope.fmu.generate.wasm import build_wasm

__all__ = ["build_fmu", "build_wasm", "find_compiler"]
