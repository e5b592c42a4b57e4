"""Many estimates in worker processes, each within a limit of time: a process that takes longer is killed."""

import json
import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from baryscope.models.errors import InputError
from baryscope.worker import answer

Task = tuple[Any, ...]
Line = dict[str, Any]


def lines_of(path: Path) -> list[Line]:
    """The lines of a file of results, none if there is none; a last one that is not complete is left out.

    Raises:
        InputError: a line is not JSON.
    """
    if not path.exists():
        return []
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(keepends=True), 1):
        if line[-1] == "\n":
            try:
                found.append(json.loads(line))
            except ValueError as error:
                raise InputError(f"{path}, line {number}: {error}, expected a result in JSON") from error
    return found


def append(path: Path, line: Line) -> None:
    """Add a line to a file of results, after the last complete one; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as stream:
        end = stream.seek(0, 2)
        while end and (stream.seek(end - 1), stream.read(1))[1] != b"\n":
            end -= 1
        stream.truncate(end)
        stream.write(json.dumps(line).encode() + b"\n")


@dataclass(eq=False)
class _Worker:
    connection: Connection
    process: SpawnProcess
    tasks: list[Task] = field(default_factory=list)
    since: float = 0.0


def run(
    function: Callable[..., Line], groups: Sequence[Sequence[Task]], workers: int, limit: float
) -> Iterator[tuple[Task, Line | None]]:
    """What `function` makes of the tasks, each with None if it takes longer than `limit` s, or ends its process.

    The tasks of a group are given to one worker, one after the other. The function must be one to import.
    """
    waiting = [list(group) for group in reversed(groups) if group]
    crew: list[_Worker] = []
    try:
        while waiting or crew:
            while waiting and len(crew) < workers:
                crew.append(_start(function, waiting.pop()))
            ready = wait([worker.connection for worker in crew], timeout=1.0)
            for worker in list(crew):
                if worker.connection in ready:
                    result = _received(worker)
                elif clock.monotonic() - worker.since > limit:
                    result = None
                else:
                    continue
                yield worker.tasks.pop(0), result
                if result is None:
                    _end(worker)
                    crew.remove(worker)
                    if worker.tasks:
                        waiting.append(worker.tasks)
                    continue
                if not worker.tasks and waiting:
                    worker.tasks = waiting.pop()
                if worker.tasks:
                    _give(worker)
                else:
                    _end(worker)
                    crew.remove(worker)
    finally:
        for worker in crew:
            _end(worker)


def _start(function: Callable[..., Line], tasks: list[Task]) -> _Worker:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=answer, args=(function, theirs), daemon=True)
    process.start()
    theirs.close()
    worker = _Worker(ours, process, tasks)
    _give(worker)
    return worker


def _give(worker: _Worker) -> None:
    worker.since = clock.monotonic()
    worker.connection.send(worker.tasks[0])


def _received(worker: _Worker) -> Line | None:
    try:
        result: Line = worker.connection.recv()
    except (EOFError, OSError):
        return None
    return result


def _end(worker: _Worker) -> None:
    worker.process.kill()
    worker.process.join()
    worker.connection.close()
