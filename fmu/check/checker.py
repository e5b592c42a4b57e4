"""Checks a whole FMU, ours or anybody's: the XML by itself, and its declarations against the binary."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from baryscope.fmu.check.binary import binary_findings
from baryscope.fmu.check.description import description_findings, read_description
from baryscope.fmu.check.finding import Finding, Severity, error
from baryscope.fmu.check.ours import is_ours, table_findings
from baryscope.fmu.layout.archive import unpack
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, temporary_folder

TIME_LIMIT = 300.0  # seconds, for all checks of the binary


def check_unit(path: AnyPath, *, isolated: bool = True) -> list[Finding]:
    """Check an FMU of FMI 2 or 3, for Co-Simulation and Model Exchange.

    fmpy validates the XML first; then come our own checks of it, and those of the binary in a separate process: token,
    start values, every declared capability, and declared dependencies against observed ones. Units of baryscope are
    also compared with the table of variables and the equations.

    Args:
        path: the FMU.
        isolated: run the binary in a separate process, where it may crash or hang; False is faster.

    Returns:
        The findings, errors first; none for a correct unit.

    Raises:
        InputError: the file cannot be read, is no FMU, or holds unsafe paths.
        DiskError: there is no room to unpack it.
    """
    path = Path(path)
    with temporary_folder() as top:
        folder = top / "unit"
        folder.mkdir()
        unpack(path, folder, "an FMU")
        _require_description(path, folder)
        try:
            description = read_description(folder)
        except LookupError as problem:
            return [error("modelDescription.xml", f"refers to a variable that does not exist ({problem})")]
        except Exception as problem:  # fmpy raises bare Exceptions
            return [error("modelDescription.xml", f"cannot be understood ({problem})")]
        findings = list(description_findings(folder, description))
        if is_ours(description):
            findings += table_findings(description)
        if not any("could not be checked" in finding.message for finding in findings):
            findings += _isolated_findings(folder, top / "results") if isolated else binary_findings(folder)
    unique = dict.fromkeys(findings)  # both interfaces often have the same ones
    return sorted(unique, key=lambda finding: finding.severity != Severity.ERROR)


def _require_description(path: Path, folder: Path) -> None:
    file = folder / "modelDescription.xml"
    if not file.is_file():
        raise InputError(f"{path}: holds no modelDescription.xml, expected an FMU")
    try:
        root = ET.parse(file).getroot()  # noqa: S314 - entities are not expanded from files
    except ET.ParseError as problem:
        raise InputError(f"{path}: modelDescription.xml is no XML ({problem}), expected an FMU") from problem
    version = root.get("fmiVersion", "none")
    if version != "2.0" and not version.startswith("3."):
        raise InputError(f"{path}: is of FMI version {version}, expected 2.0 or 3.0")


def _isolated_findings(folder: Path, results: Path) -> Iterator[Finding]:
    command = [sys.executable, "-m", "baryscope.fmu.check", str(folder), str(results)]
    try:
        process = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT, check=False
        )
        ending = f"ended with code {process.returncode}: {(process.stderr.strip().splitlines() or ['no message'])[-1]}"
    except subprocess.TimeoutExpired:
        ending = f"had not ended after {TIME_LIMIT:.0f} s"
    lines = results.read_text(encoding="utf-8").splitlines() if results.is_file() else []
    doing, done = "loading", False
    for line in lines:
        record: dict[str, Any] = json.loads(line)
        if "severity" in record:
            yield Finding(Severity(record["severity"]), record["subject"], record["message"])
        doing, done = record.get("doing", doing), record.get("done", done)
    if not done:
        yield error(doing, f"the process that ran the binary {ending}")
