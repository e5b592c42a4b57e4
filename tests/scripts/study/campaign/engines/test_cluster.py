"""Campaigns on a dask cluster: a scheduler and workers as processes of their own, killed in the middle."""

import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from baryscope.models.errors import ComputationError, InputError
from baryscope.scripts.cli import app
from baryscope.study.campaign import connected, mended, plan_of, read_plan, run_one
from baryscope.study.campaign.engines import ClusterEngine, LocalEngine
from baryscope.study.campaign.folder import RUNS

distributed = pytest.importorskip("distributed.comm", reason="needs dask.distributed (baryscope[cluster])")

QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
DRAWS = 10


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """The scheduler's file, its process, and those of two workers with a thread each."""
    folder = tmp_path_factory.mktemp("cluster")
    address, environment = folder / "scheduler.json", os.environ | {"OPENBLAS_NUM_THREADS": "1"}

    def started(program, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{program}", "--scheduler-file", address, "--no-dashboard"]
        return subprocess.Popen([*command, *arguments], cwd=folder, env=environment, **QUIET)

    scheduler = started("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
    while not address.exists():
        assert scheduler.poll() is None
        time.sleep(0.05)
    options = ("--nthreads", "1", "--no-nanny", "--host", "127.0.0.1", "--local-directory", folder)
    workers = [started("dask_worker", *options) for _ in range(2)]
    yield address, scheduler, workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def options(scenario_file):
    """Of a campaign of some 50 ms a draw, over a range, too: the method is a quick one."""
    varied = ["attitude", "sensor.noise=0.01:0.03"]
    return ["--scenario", str(scenario_file), "--methods", "score", "--draws", str(DRAWS), "--vary", *varied]


@pytest.fixture(scope="module")
def expected(options, unit):
    """The lines of all draws, made one after the other in this process."""
    plan = plan_of([options[1]], methods=["score"], draws=DRAWS, vary=options[-2:])
    return {number: without_wall(run_one(plan.case("small", number, str(unit)))) for number in range(DRAWS)}


def without_wall(run):
    return {name: value for name, value in run.items() if name != "wall"}


def lines_of(folder):
    lines = [json.loads(line) for line in (folder / RUNS).read_text(encoding="utf-8").splitlines()]
    return {line["case"]: without_wall(line) for line in lines}


def killed_after(process, path, count):
    """A thread that kills a process as soon as a file has so many lines."""

    def watch():
        while process.poll() is None and not (path.exists() and path.read_bytes().count(b"\n") >= count):
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()

    thread = threading.Thread(target=watch)
    thread.start()
    return thread


def logged(monkeypatch, name):
    """What a logger, which has a level and handlers of its own, lets through from now on."""
    said, handler = [], logging.Handler()
    handler.emit = lambda record: said.append(record.getMessage())
    monkeypatch.setattr(logging.getLogger(name), "handlers", [handler])
    return said


def test_a_killed_workers_cases_are_run_again(cluster, options, expected, tmp_path, capsys):
    """The lines are those of this process, to the last bit, though one worker of two ends in the middle."""
    address, _, workers = cluster
    with connected(str(address)) as client:
        client.wait_for_workers(2, timeout=120)
    watch = killed_after(workers[0], tmp_path / RUNS, 2)
    assert app.main(["campaign", *options, "--scheduler", str(address), "-o", str(tmp_path)]) == 0
    watch.join()
    assert workers[0].returncode == -signal.SIGKILL
    assert lines_of(tmp_path) == expected
    assert (tmp_path / RUNS).read_bytes().count(b"\n") == DRAWS
    assert f"{DRAWS} runs on tcp://127.0.0.1:" in capsys.readouterr().err


def test_workers_check_the_program(cluster, options):
    """Before anything is run, and each one once more before each run, for those that come later."""
    address, _, _ = cluster
    words = r"worker tcp://127.0.0.1:\d+: runs the program \w{12} on \S+, expected of yesterday"
    plan = plan_of([options[1]], methods=["score"], draws=1)
    with connected(str(address)) as client:
        with pytest.raises(InputError, match=words):
            ClusterEngine(client, "of yesterday")
        engine = ClusterEngine(client)
        engine._program = "of yesterday"
        with pytest.raises(InputError, match=words):
            list(engine.carry_out([plan.case("small", 0, options[1])]))


def test_a_lost_scheduler_loses_nothing_that_was_written(cluster, options, expected, tmp_path, capsys, monkeypatch):
    """Nor does dask's client tell how it could not connect again: it wrote 40 lines of traceback above ours."""
    address, scheduler, _ = cluster
    watch, said = killed_after(scheduler, tmp_path / RUNS, 2), logged(monkeypatch, "distributed.client")
    assert app.main(["campaign", *options, "--scheduler", str(address), "-o", str(tmp_path)]) == 1
    watch.join()
    assert said == []
    line = capsys.readouterr().err.splitlines()[-1]
    kept = mended(tmp_path, read_plan(tmp_path)).count
    assert 2 <= kept < DRAWS
    assert "the scheduler is lost" in line
    assert f"{kept} of {DRAWS} runs are kept in {tmp_path}, and the same command goes on" in line
    monkeypatch.setattr(LocalEngine, "carry_out", lambda _, cases: (run_one(case) for case in cases))
    assert app.main(["campaign", *options, "-o", str(tmp_path)]) == 0
    assert lines_of(tmp_path) == expected
    assert (tmp_path / RUNS).read_bytes().count(b"\n") == DRAWS


def test_a_scheduler_that_is_lost_before_the_first_run():
    """It was "the workers do not answer: in <TCP (closed) ConnectionPool.broadcast …>: Stream is closed"."""

    class Scheduler:
        address = "tcp://there:8786"

    class Client:
        scheduler = Scheduler()

        def run(self, *_, **__):
            raise distributed.CommClosedError("in <TCP (closed) ConnectionPool.broadcast>: Stream is closed")

    with pytest.raises(ComputationError, match=r"^tcp://there:8786: the scheduler is lost, before it told"):
        ClusterEngine(Client(), "a program")


@pytest.mark.parametrize("scheduler, words", [
    ("nonsense", "nonsense: is no address, expected tcp://HOST:PORT or a scheduler's FILE.json"),
    ("none.json", "none.json: no such file, expected tcp://HOST:PORT or a scheduler's FILE.json"),
])  # fmt: skip
def test_a_scheduler_that_is_none(scheduler, words, options, tmp_path, capsys):
    assert app.main(["campaign", *options, "--scheduler", scheduler, "-o", str(tmp_path)]) == 2
    assert words in capsys.readouterr().err
