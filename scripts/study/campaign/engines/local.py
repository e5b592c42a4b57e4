"""Worker processes: each takes one task after the other and sends back what came of it.

The standard library's pools either wait forever for a worker that was killed or cannot be stopped at once; a campaign
needs neither: a task whose worker was killed goes to a new one.
"""

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar, cast

from baryscope.models.errors import ComputationError
from baryscope.models.words import counted
from baryscope.study.campaign.case import Case, run_one
from baryscope.study.campaign.engines.engine import ATTEMPTS
from baryscope.threads import THREADS
from baryscope.worker import work

Task = TypeVar("Task")
Result = TypeVar("Result")

PATIENCE = 3.0  # s until a worker that does not end is killed


def usable_cores() -> int:
    """How many cores this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class LocalEngine:
    """Worker processes of this machine, one for each usable core unless told."""

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or usable_cores()

    def __str__(self) -> str:
        return f"in {counted(self._workers, 'process', 'processes')}"

    def carry_out(self, cases: Iterable[Case]) -> Generator[dict[str, Any], None, None]:
        """As `Engine` says."""
        return results_of(run_one, cases, self._workers)


@dataclass
class _Worker:
    """A process, what it does, and how often others have ended at it."""

    process: SpawnProcess
    task: Any
    lost: int = 0


def results_of(
    function: Callable[[Task], Result], tasks: Iterable[Task], workers: int
) -> Generator[Result, None, None]:
    """What `function` makes of each task, in the order in which they end.

    The function must be one that a new process can import. A task whose worker is ended from outside is done again by
    a new one. Closing the iterator ends the workers.

    Raises:
        ComputationError: the function has raised it, which must be its only exception, or ATTEMPTS workers have been
            ended from outside at the same task.
    """
    waiting = iter(tasks)
    crew: dict[Connection, _Worker] = {}
    try:
        for task in islice(waiting, workers):
            _start(crew, function, task)
        busy = set(crew)
        while busy:
            for ready in wait(list(busy)):
                connection = cast(Connection, ready)
                worker = crew[connection]
                try:
                    result = connection.recv()
                except (EOFError, OSError):
                    busy.discard(connection)
                    busy.add(_replaced(crew, connection, function))
                    continue
                if isinstance(result, ComputationError):
                    raise result
                worker.task, worker.lost = next(waiting, None), 0
                with suppress(OSError):  # it has ended since; we shall see
                    connection.send(worker.task)
                if worker.task is None:
                    busy.discard(connection)
                yield cast(Result, result)
    finally:
        _end(crew)


def _replaced(crew: dict[Connection, _Worker], connection: Connection, function: Callable[[Any], Any]) -> Connection:
    """A new worker for the task of one that has ended."""
    gone = crew.pop(connection)
    connection.close()
    gone.process.join(PATIENCE)
    if gone.lost + 1 >= ATTEMPTS:
        code = gone.process.exitcode
        raise ComputationError(f"a worker process has ended with the code {code}, {ATTEMPTS} times at the same task")
    return _start(crew, function, gone.task, gone.lost + 1)


def _start(crew: dict[Connection, _Worker], function: Callable[[Any], Any], task: Any, lost: int = 0) -> Connection:
    with _for_workers():
        connection, process = _process(function)
    crew[connection] = _Worker(process, task, lost)
    with suppress(OSError):
        connection.send(task)
    return connection


def _process(function: Callable[[Any], Any]) -> tuple[Connection, SpawnProcess]:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=work, args=(function, theirs), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def _end(crew: dict[Connection, _Worker]) -> None:
    for worker in crew.values():
        worker.process.terminate()
    for connection, worker in crew.items():
        worker.process.join(PATIENCE)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()
        connection.close()


@contextmanager
def _for_workers() -> Iterator[None]:
    """While processes are started: one thread each, and an interrupt is for the parent alone, whatever they load."""
    before = {name: os.environ.get(name) for name in THREADS}
    main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if main:
            signal.signal(signal.SIGINT, handler)
