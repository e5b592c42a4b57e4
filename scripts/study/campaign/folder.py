"""A campaign's folder: campaign.json says what is run, runs.jsonl has a line for each run that has ended."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_text, replacing, unwritable
from baryscope.study.campaign.plan import Plan

HEADER, RUNS = "campaign.json", "runs.jsonl"
Run = dict[str, Any]


def read_plan(folder: AnyPath) -> Plan:
    """The plan of the campaign in a folder.

    Raises:
        InputError: there is none.
    """
    path = Path(folder) / HEADER
    try:
        header = json.loads(read_text(path, "the header of a campaign"))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: line {error.lineno} is not JSON, expected the header of a campaign") from error
    if not isinstance(header, dict):
        raise InputError(f"{path}: found a {type(header).__name__}, expected the header of a campaign")
    return Plan.of_header(header, path)


def begin(folder: AnyPath, plan: Plan, *, restart: bool = False) -> Plan:
    """Make the folder ready for a plan's runs; those that are there must be of the same plan, unless we start afresh.

    Returns:
        The plan, with the higher number of draws of the two.

    Raises:
        InputError: the runs in the folder are of another plan, or the folder cannot be written.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, expected a folder to write to")
    runs = folder / RUNS
    if restart:
        runs.unlink(missing_ok=True)
    elif (folder / HEADER).exists():
        found = read_plan(folder)
        difference = plan.difference(found)
        if difference is not None:
            raise InputError(
                f"{folder}: holds a campaign with {difference}; expected the same options, --restart or another folder"
            )
        plan = replace(plan, draws=max(plan.draws, found.draws))
    elif runs.exists():
        raise InputError(f"{runs}: found without {HEADER}, expected both; --restart begins anew")
    with replacing(folder / HEADER) as temporary:
        text = json.dumps(plan.header(), indent=1, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    return plan


def read_runs(folder: AnyPath, plan: Plan, *, mend: bool = False) -> dict[tuple[str, int], Run]:
    """The runs that have ended, by scenario and number. A last line that was torn is none; mend cuts it off the file.

    Raises:
        InputError: a line that is no run of this plan.
    """
    path = Path(folder) / RUNS
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}, expected the runs of a campaign") from error
    lines = content.split(b"\n")
    whole, rest = lines[:-1], lines[-1]
    if whole and _parsed(whole[-1]) is None:  # its end may be there when its middle is not
        rest = whole.pop() + b"\n" + rest
    if mend and rest:
        os.truncate(path, len(content) - len(rest))
    known = {(entry.name, number) for entry in plan.entries for number in range(plan.draws)}
    runs: dict[tuple[str, int], Run] = {}
    for number, line in enumerate(whole, start=1):
        run = _parsed(line)
        if run is None:
            raise InputError(f"{path}: line {number} is not the JSON of a run, expected one run a line")
        key = (run["scenario"], run["case"])
        if key not in known or set(run["methods"]) != set(plan.methods):
            raise InputError(f"{path}: line {number} is of {key[0]}, draw {key[1]}, expected a run of {HEADER}")
        runs.setdefault(key, run)
    return runs


def _parsed(line: bytes) -> Run | None:
    """The run of a line; None if it is none."""
    try:
        run = json.loads(line)
    except ValueError:
        return None
    shape = {"scenario": str, "case": int, "bound": dict, "methods": dict, "wall": dict}
    right = isinstance(run, dict) and all(isinstance(run.get(name), kind) for name, kind in shape.items())
    return run if right else None


class RunFile:
    """runs.jsonl, open for more lines; each is on the disk when `append` returns."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / RUNS
        try:
            self._stream = self._path.open("ab", buffering=0)
        except OSError as error:
            raise unwritable(self._path, error) from error

    def append(self, run: Run) -> None:
        """Add the line of a run.

        Raises:
            DiskError: the disk is full, or fails; the line may be torn.
        """
        line = json.dumps(run, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        try:
            if self._stream.write(line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise unwritable(self._path, error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()
