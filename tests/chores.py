"""What the tests have workers do. It imports little, as each worker does."""

import atexit
import os
import signal
import time

from baryscope.models.errors import DiskError
from baryscope.threads import THREADS


def threads(path):
    """What a worker's threads are; the process that is asked first ends at once."""
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return [os.getenv(name) for name in THREADS]


def slow_to_leave(seconds):
    atexit.register(time.sleep, seconds)


def another_exception(folder):
    """As a library whose calls of Python fail; the second worker has nothing to do."""
    try:
        if not (folder / "begun").exists():
            (folder / "begun").touch()
            os.kill(os.getpid(), signal.SIGTERM)
    except SystemExit:
        raise NotImplementedError("wrong number or type of arguments") from None


def mistaken(text):
    raise NotImplementedError(text)


def refused(number):
    raise DiskError(f"no room for {number}")
