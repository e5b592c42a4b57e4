"""The life of a worker process. It imports next to nothing: a process whose task needs little begins at once."""

import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any

from baryscope.models.errors import ComputationError


def work(function: Callable[[Any], Any], connection: Connection) -> None:
    """Until there is no more to do (the task None), or nobody to do it for; a ComputationError is sent as a result."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    try:
        while (task := connection.recv()) is not None:
            connection.send(_done(function, task))
    except (EOFError, OSError):
        pass
    except Exception:
        if signal.getsignal(signal.SIGTERM) is _leave:
            raise
        sys.exit(128 + signal.SIGTERM)  # a library has made another exception of the one by which we leave
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # on the way out it would be an exception that nobody catches


def answer(function: Callable[..., Any], connection: Connection) -> None:
    """Until nobody asks: what the function makes of the arguments that come. Who asks ends it by a kill."""
    while True:
        try:
            arguments = connection.recv()
        except EOFError:
            return
        found = function(*arguments)
        try:
            connection.send(found)
        except BrokenPipeError:  # who asked has been killed
            return


def _done(function: Callable[[Any], Any], task: Any) -> Any:
    try:
        return function(task)
    except ComputationError as error:
        return error


def _leave(number: int, frame: FrameType | None) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(128 + number)  # an exception, so that temporary files are removed on the way out
