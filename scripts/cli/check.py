"""`baryscope check`: whether an FMU does what its description says."""

from dataclasses import asdict
from pathlib import Path

from baryscope import __version__
from baryscope.fmu.check import Severity, check_unit
from baryscope.models.errors import ComputationError
from baryscope.scripts.cli.console import Show


def check(unit: Path, *, show: Show | None = None) -> None:
    """Check an FMU of any tool: fmpy's validation, then what its description says against what its binary does.

    Compared are token, start values, units, dependencies and capabilities. Prints one line for each finding,
    `error: …` or `warning: …`, or `no findings`. The exit code is 1 if there are errors.

    Parameters
    ----------
    unit
        The FMU, of FMI 2 or 3.
    """
    findings = check_unit(unit)
    data = {"version": __version__, "unit": str(unit), "findings": [asdict(finding) for finding in findings]}
    (show or Show()).result(data, *(map(str, findings) if findings else ["no findings"]))
    errors = sum(finding.severity == Severity.ERROR for finding in findings)
    if errors:
        raise ComputationError(f"{unit}: {errors} error{'s' * (errors > 1)} found")
