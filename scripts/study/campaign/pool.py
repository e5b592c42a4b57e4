"""Worker processes: each takes one task after the other and sends back what came of it.

The standard library's pools either wait forever for a worker that was killed or cannot be stopped at once; a campaign
needs neither.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import FrameType
from typing import Any, TypeVar, cast

from baryscope.models.errors import ComputationError
from baryscope.threads import THREADS

Task = TypeVar("Task")
Result = TypeVar("Result")

PATIENCE = 3.0  # s until a worker that does not end is killed


def usable_cores() -> int:
    """How many cores this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def results_of(
    function: Callable[[Task], Result], tasks: Iterable[Task], workers: int
) -> Generator[Result, None, None]:
    """What `function` makes of each task, in the order in which they end.

    The function must be one that a new process can import. Closing the iterator ends the workers.

    Raises:
        ComputationError: the function has raised it, which must be its only exception, or a worker was ended from
            outside.
    """
    waiting = iter(tasks)
    crew: dict[Connection, SpawnProcess] = {}
    try:
        with _for_workers():
            for task in islice(waiting, workers):
                connection, process = _start(function)
                crew[connection] = process
                connection.send(task)
        busy = set(crew)
        while busy:
            for ready in wait(list(busy)):
                connection = cast(Connection, ready)
                try:
                    result = connection.recv()
                    task_left = next(waiting, None)
                    connection.send(task_left)
                except (EOFError, OSError) as error:
                    process = crew[connection]
                    process.join(PATIENCE)
                    raise ComputationError(f"a worker process has ended with the code {process.exitcode}") from error
                if isinstance(result, ComputationError):
                    raise result
                if task_left is None:
                    busy.discard(connection)
                yield cast(Result, result)
    finally:
        _end(crew)


def _start(function: Callable[[Any], Any]) -> tuple[Connection, SpawnProcess]:
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(function, theirs), daemon=True)
    process.start()
    theirs.close()
    return ours, process


def _work(function: Callable[[Any], Any], connection: Connection) -> None:
    """The life of a worker: until there is no more to do, or nobody to do it for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    with suppress(EOFError, OSError):
        while (task := connection.recv()) is not None:
            connection.send(_done(function, task))
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # on the way out it would be an exception that nobody catches


def _done(function: Callable[[Any], Any], task: Any) -> Any:
    try:
        return function(task)
    except ComputationError as error:
        return error


def _leave(number: int, frame: FrameType | None) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(128 + number)  # an exception, so that temporary files are removed on the way out


def _end(crew: dict[Connection, SpawnProcess]) -> None:
    for process in crew.values():
        process.terminate()
    for connection, process in crew.items():
        process.join(PATIENCE)
        if process.is_alive():
            process.kill()
            process.join()
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
