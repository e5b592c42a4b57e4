"""A campaign on the workers of a dask cluster.

The scheduler hands out single runs; a few for each worker are with it at a time, so that neither it nor this process
holds more for more draws. The unit goes to each worker once, as a result of the cluster that dask makes again where it
was lost. What has ended is written here, by the process that asks for it.
"""

import hashlib
import logging
import queue
import re
import threading
import warnings
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from baryscope.models.errors import ComputationError, InputError
from baryscope.models.words import counted
from baryscope.study.campaign.case import Case, run_one
from baryscope.study.campaign.engines.engine import ATTEMPTS
from baryscope.study.campaign.program import program_here

if TYPE_CHECKING:
    from distributed import Client, Future

IN_HAND = 3  # runs for each thread that the scheduler has at a time, so that none waits for work
LEAST_IN_HAND = 8  # while there are few workers or none
TO_CONNECT = 20.0  # s
LOOK = 1.0  # s between looks at how many threads there are


class ClusterEngine:
    """The workers of a cluster, those that come and go while it runs, too.

    Args:
        client: connected to the cluster; it is left open.
        program: what the workers must run, see `program_here`; the same as this process unless given.

    Raises:
        InputError: a worker runs another program, or cannot import this one.
    """

    def __init__(self, client: "Client", program: str | None = None) -> None:
        self._client = client
        self._program = program or program_here()
        self._address = client.scheduler.address if client.scheduler is not None else "the scheduler"
        self._most, self._looked = LEAST_IN_HAND, 0.0
        _check_workers(client, self._program, self._address)

    def __str__(self) -> str:
        return f"on {self._address}, {counted(self._threads(), 'thread')} now"

    def carry_out(self, cases: Iterable[Case]) -> Generator[dict[str, Any], None, None]:
        """As `Engine` says."""
        waiting = iter(cases)
        running: set[Future] = set()
        units: dict[str, Future] = {}
        ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        try:
            while True:
                for case in islice(waiting, self._room(len(running))):
                    future = self._submitted(case, units)
                    running.add(future)
                    future.add_done_callback(ended.put)
                if not running:
                    return
                try:
                    future = ended.get(timeout=LOOK)
                except queue.Empty:
                    if self._client.status != "running":
                        raise ComputationError(self._lost()) from None
                    continue
                running.discard(future)
                yield self._result(future)
        finally:
            if self._client.status == "running":
                with suppress(Exception):  # the scheduler may go at this moment; what was yielded is safe
                    self._client.cancel([*running, *units.values()], force=True)

    def _room(self, running: int) -> int:
        """How many cases more to hand to the scheduler."""
        if monotonic() > self._looked + LOOK:
            self._looked = monotonic()
            with suppress(OSError):  # the scheduler is gone, as the runs will say
                self._most = max(LEAST_IN_HAND, IN_HAND * self._threads())
        return max(0, self._most - running)

    def _threads(self) -> int:
        """How many threads the workers have now."""
        return sum(self._client.nthreads().values())

    def _lost(self) -> str:
        return f"{self._address}: the scheduler is lost, or has dropped the runs"

    def _submitted(self, case: Case, units: dict[str, "Future"]) -> "Future":
        if case.unit not in units:
            content = Path(case.unit).read_bytes()
            key = f"baryscope-unit-{hashlib.sha256(content).hexdigest()}"
            units[case.unit] = self._client.submit(bytes, content, key=key, retries=ATTEMPTS)
        return self._client.submit(
            run_there,
            replace(case, unit=""),
            units[case.unit],
            self._program,
            key=f"baryscope-run-{case.plan}-{case.scenario['name']}-{case.number}",
            pure=False,
        )

    def _result(self, future: "Future") -> dict[str, Any]:
        if future.status == "finished":
            result: dict[str, Any] = future.result()
            return result
        if future.status != "error":
            raise ComputationError(self._lost())
        error = future.exception()
        if isinstance(error, ComputationError | InputError):
            raise error
        name = future.key.removeprefix("baryscope-run-")
        if type(error).__name__ == "KilledWorker":
            raise ComputationError(f"{self._address}: {name} has ended all workers that ran it") from error
        raise ComputationError(f"{self._address}: {name}: {type(error).__name__}: {error}") from error


@contextmanager
def connected(scheduler: str) -> Iterator["Client"]:
    """A client of the scheduler at an address, tcp://HOST:PORT, or of a scheduler's file, FILE.json.

    What dask logs meanwhile is not shown.

    Raises:
        InputError: dask.distributed is not installed, or the address is none.
        ComputationError: nobody answers there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        wanted = "expected it installed: pip install 'baryscope[cluster]'"
        raise InputError(f"{scheduler}: needs dask.distributed, {wanted}") from error
    expected = "expected tcp://HOST:PORT or a scheduler's FILE.json"
    of_file = scheduler.endswith(".json")
    if of_file and not Path(scheduler).is_file():
        raise InputError(f"{scheduler}: no such file, {expected}")
    if not of_file and not re.fullmatch(r"(\w+://)?[^/\s]+:\d+", scheduler):
        raise InputError(f"{scheduler}: is no address, {expected}")
    with _silent("distributed"):
        try:
            where = {"scheduler_file": scheduler} if of_file else {"address": scheduler}
            client = Client(**where, timeout=TO_CONNECT, set_as_default=False)
        except (ValueError, TypeError, KeyError) as error:
            raise InputError(f"{scheduler}: {error}, {expected}") from error
        except OSError as error:
            raise ComputationError(f"{scheduler}: no scheduler answers within {TO_CONNECT:.0f} s") from error
        try:
            yield client
        finally:
            client.close(timeout=2)


@contextmanager
def _silent(name: str) -> Iterator[None]:
    """A logger and those below it log nothing; they may have levels of their own, as dask gives them."""
    below = [logging.getLogger(one) for one in logging.root.manager.loggerDict if one.startswith(f"{name}.")]
    levels = [(logger, logger.level) for logger in (logging.getLogger(name), *below)]
    for logger, _ in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels:
            logger.setLevel(level)


def run_there(case: Case, unit: bytes, program: str) -> dict[str, Any]:
    """`run_one` on a worker, one at a time in its process; unit is an FMU.

    Raises:
        InputError: the worker's program is another one.
    """
    from distributed import get_worker

    worker = get_worker()
    if program_here() != program:
        raise InputError(_foreign(worker.address, program_here(), program))
    kept = Path(worker.local_directory) / f"{hashlib.sha256(unit).hexdigest()}.fmu"
    with _ALONE:
        if not kept.exists():
            kept.write_bytes(unit)
        return run_one(replace(case, unit=str(kept)))


_ALONE = threading.Lock()  # what a run warns of is caught for the whole process


def _check_workers(client: "Client", wanted: str, address: str) -> None:
    """That the workers that are there run this program, with a thread each; address: of the scheduler."""
    try:
        found = client.run(program_here, on_error="return")
    except OSError as error:
        raise ComputationError(f"{address}: the scheduler is lost, before it told what its workers run") from error
    for worker, program in found.items():
        if isinstance(program, BaseException):
            raise InputError(
                f"worker {worker}: {type(program).__name__}: {program}; expected baryscope installed there"
            )
        if program != wanted:
            raise InputError(_foreign(worker, program, wanted))
    wide = sum(threads > 1 for threads in client.nthreads().values())
    if wide:
        text = f"{counted(wide, 'worker')} with several threads, of which a run uses one: dask worker --nthreads 1"
        warnings.warn(text, stacklevel=2)


def _foreign(worker: str, found: str, wanted: str) -> str:
    return f"worker {worker}: runs the program {found}, expected {wanted}: the same baryscope, machines of one kind"
