"""Worker processes: what they return and raise, and how they end."""

import atexit
import multiprocessing
import os
import sys
import time

import pytest

from baryscope.models.errors import ComputationError, DiskError
from baryscope.study.campaign.pool import THREADS, results_of

COMMAND = [sys.executable, "-m", "baryscope.scripts.cli.app"]


def test_a_worker_has_one_thread_and_the_parent_keeps_its_own(monkeypatch):
    monkeypatch.setenv(THREADS[0], "7")
    assert set(results_of(os.getenv, THREADS, 1)) == {"1"}
    assert os.environ[THREADS[0]] == "7"


def test_a_worker_that_is_killed_does_not_keep_us_waiting():
    with pytest.raises(ComputationError, match="a worker process has ended with the code 9"):
        list(results_of(os._exit, [9, 9], 1))
    assert not multiprocessing.active_children()


def slow_to_leave(seconds):
    atexit.register(time.sleep, seconds)


def test_a_worker_that_is_on_its_way_out_is_not_disturbed(capfd):
    """It is terminated while it runs what it does at its exit; a traceback of that would be seen on the terminal."""
    assert list(results_of(slow_to_leave, [0.5], 1)) == [None]
    assert capfd.readouterr().err == ""


def test_closing_ends_the_workers():
    """They would sleep for a day, and closing would not return before."""
    results = results_of(time.sleep, [0, 86_400, 86_400], 2)
    assert next(results) is None
    results.close()
    assert not multiprocessing.active_children()


def refused(number):
    raise DiskError(f"no room for {number}")


def test_what_a_worker_raises_is_raised_here_and_ends_the_others():
    with pytest.raises(DiskError, match="no room for 7"):
        list(results_of(refused, [7, 7], 2))
    assert not multiprocessing.active_children()
