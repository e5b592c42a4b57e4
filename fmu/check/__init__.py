"""What doubts a unit: checks of anybody's FMU, of its modelDescription.xml and of what its binary does.

The binary runs in a process of its own, `python -m baryscope.fmu.check`; findings are errors or warnings.
"""

from baryscope.fmu.check.checker import check_unit
from baryscope.fmu.check.finding import Finding, Severity

__all__ = ["Finding", "Severity", "check_unit"]
