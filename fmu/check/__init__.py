"""Checks FMUs, ours or anybody's: modelDescription.xml by itself, and against the behaviour of the binary.

The binary runs in a separate process, `python -m baryscope.fmu.check`. Findings are errors or warnings.
"""

from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.check.finding import Finding, Severity

__all__ = ["Finding", "Severity", "check_unit"]
