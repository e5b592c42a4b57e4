"""The command line's linear algebra runs on one thread, unless the user wants more."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from baryscope.threads import THREADS

COUNT = """
import os
import baryscope.scripts.cli.app
import numpy as np
before = len(os.listdir("/proc/self/task"))
np.ones((1000, 1000)) @ np.ones((1000, 1000))
print(os.environ["OPENBLAS_NUM_THREADS"], before)
"""


def threads_of_the_command_line(**variables):
    """What the variable is after the command line is imported, and how many threads the process has."""
    environment = {name: value for name, value in os.environ.items() if name not in THREADS} | variables
    done = subprocess.run([sys.executable, "-c", COUNT], env=environment, capture_output=True, text=True, check=True)
    return tuple(int(word) for word in done.stdout.split())


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the system does not list a process's threads")
def test_one_thread_unless_the_user_wants_more():
    wanted, threads = threads_of_the_command_line()
    assert wanted == 1
    more_wanted, more = threads_of_the_command_line(OPENBLAS_NUM_THREADS="3")
    assert more_wanted == 3
    assert more > threads
