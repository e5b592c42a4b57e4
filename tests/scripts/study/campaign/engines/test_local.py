"""Worker processes: what they return and raise, and how they end."""

import multiprocessing
import os
import time

import pytest

import chores
from baryscope.models.errors import ComputationError, DiskError
from baryscope.study.campaign.engines import local
from baryscope.study.campaign.engines.local import THREADS, results_of


def test_a_task_whose_worker_is_killed_is_done_by_another_of_one_thread(tmp_path, monkeypatch):
    """And the parent keeps the threads that it has."""
    monkeypatch.setenv(THREADS[0], "7")
    assert list(results_of(chores.threads, [tmp_path / "once"], 1)) == [["1"] * len(THREADS)]
    assert os.environ[THREADS[0]] == "7"


def test_a_task_that_ends_all_its_workers_does_not_keep_us_waiting(monkeypatch):
    monkeypatch.setattr(local, "ATTEMPTS", 1)
    with pytest.raises(ComputationError, match="a worker process has ended with the code 9, 1 times at the same task"):
        list(results_of(os._exit, [9, 9], 1))
    assert not multiprocessing.active_children()


def test_a_worker_that_is_on_its_way_out_is_not_disturbed(capfd):
    """It is terminated while it runs what it does at its exit; a traceback of that would be seen on the terminal."""
    assert list(results_of(chores.slow_to_leave, [0.5], 1)) == [None]
    assert capfd.readouterr().err == ""


def test_a_worker_whose_library_makes_another_exception_of_its_end_leaves_in_silence(tmp_path, capfd):
    assert list(results_of(chores.another_exception, [tmp_path], 1)) == [None]
    assert (tmp_path / "begun").exists()
    assert capfd.readouterr().err == ""


def test_a_mistake_of_ours_in_a_worker_is_seen(monkeypatch, capfd):
    monkeypatch.setattr(local, "ATTEMPTS", 1)
    with pytest.raises(ComputationError, match="a worker process has ended"):
        list(results_of(chores.mistaken, ["where it is"], 1))
    assert "NotImplementedError: where it is" in capfd.readouterr().err


def test_closing_ends_the_workers():
    """They would sleep for a day, and closing would not return before."""
    results = results_of(time.sleep, [0, 86_400, 86_400], 2)
    assert next(results) is None
    results.close()
    assert not multiprocessing.active_children()


def test_what_a_worker_raises_is_raised_here_and_ends_the_others():
    with pytest.raises(DiskError, match="no room for 7"):
        list(results_of(chores.refused, [7, 7], 2))
    assert not multiprocessing.active_children()
