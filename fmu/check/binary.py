"""The checks that run a unit's binary; `python -m baryscope.fmu.check FOLDER RESULTS` runs them in its own process.

A crash or hang of the binary affects that process only. Results are lines of JSON: the check that is running, and
findings.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from baryscope.fmu.check.capabilities import PROBES
from baryscope.fmu.check.dependencies import run_dependency_findings, start_dependency_findings
from baryscope.fmu.check.description import interfaces, read_description
from baryscope.fmu.check.finding import Finding, error
from baryscope.fmu.check.instance import RefusedError
from baryscope.fmu.check.life import LIFE
from baryscope.fmu.check.ours import OURS, is_ours
from baryscope.fmu.check.ramps import ramp_findings

ALL_PROBES = (
    PROBES
    | LIFE
    | {
        "derivatives of inputs": ramp_findings,
        "dependencies at the start": start_dependency_findings,
        "dependencies in a run": run_dependency_findings,
    }
    | OURS
)


def binary_findings(folder: Path, begin: Callable[[str], None] = lambda what: None) -> Iterator[Finding]:
    """All checks that run the binary of an unpacked unit.

    Args:
        folder: where it was unpacked.
        begin: called with the name of each check before it runs.
    """
    description = read_description(folder)
    for name in interfaces(description):
        for title, probe in ALL_PROBES.items():
            if title in OURS and not is_ours(description):
                continue
            begin(f"{name}, {title}")
            try:
                yield from probe(folder, description, name)
            except RefusedError as refusal:
                yield error(f"{name}, {title}", str(refusal))
                if probe is PROBES["instantiation"]:
                    break


def main(folder: Path, results: Path) -> None:
    """Run the checks and write the results, line by line."""
    with results.open("w", encoding="utf-8") as stream:

        def tell(**what: object) -> None:
            print(json.dumps(what), file=stream, flush=True)

        for finding in binary_findings(folder, lambda what: tell(doing=what)):
            tell(severity=finding.severity, subject=finding.subject, message=finding.message)
        tell(done=True)
