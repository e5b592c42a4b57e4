"""A campaign's folder: campaign.json says what is run, runs.jsonl has a line for each run that has ended.

.lock is held by the process that carries out the campaign.
"""

import errno
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_text, refuse_file, replacing, unwritable
from baryscope.study.campaign.plan import Plan

HEADER, RUNS, LOCK = "campaign.json", "runs.jsonl", ".lock"
Run = dict[str, Any]


@contextmanager
def alone_in(folder: AnyPath) -> Iterator[None]:
    """Keep other processes from carrying out the campaign of a folder; its end, of whatever kind, lets them in again.

    A folder that is missing is made. Where the file system has no locks, nobody is kept out.

    Raises:
        InputError: another process is there, or the folder cannot be written.
    """
    folder = Path(folder)
    refuse_file(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK).open("ab")
    except OSError as error:
        raise unwritable(folder, error) from error
    with file:
        if not _free(file.fileno()):
            raise InputError(f"{folder}: found another process that carries out its campaign, expected one at a time")
        yield


def _free(file: int) -> bool:
    """Whether nobody else holds the lock of an open file, which is held from now on until it is closed."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
    return True


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
    refuse_file(folder)
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
    write_plan(plan, folder / HEADER)
    return plan


def write_plan(plan: Plan, path: Path) -> None:
    """Write the header of a campaign.

    Raises:
        InputError, DiskError: it cannot be written.
    """
    with replacing(path) as temporary:
        text = json.dumps(plan.header(), indent=1, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")


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
