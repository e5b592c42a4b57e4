"""Builds units: C code from CasADi, modelDescription.xml, the compiler and its cache, and the packed FMU.

The hand-written half of the C code is in csrc/; the layout of the result is in baryscope.fmu.layout.
"""

from baryscope.fmu.generate.build import build_fmu
from baryscope.fmu.generate.compiler import find_compiler
from baryscope.fmu.generate.wasm import build_wasm

__all__ = ["build_fmu", "build_wasm", "find_compiler"]
