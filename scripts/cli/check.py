"""`baryscope check`: whether an FMU, ours or anyone's, is what it says."""

from dataclasses import asdict
from pathlib import Path

from baryscope import __version__
from baryscope.fmu.check import Severity, check_unit
from baryscope.models.errors import ComputationError
from baryscope.scripts.cli.console import Show


def check(unit: Path, *, show: Show | None = None) -> None:
    """Check an FMU: fmpy's validation, then token, starts, units, dependencies and capabilities against the binary.

    Prints one line a finding, `error: …` or `warning: …`, or `no findings`. Ends with 1 if there are errors.

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
