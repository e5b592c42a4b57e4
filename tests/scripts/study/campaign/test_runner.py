"""Campaigns: any number of workers, going on after whatever happened."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest

from baryscope.models.errors import InputError
from baryscope.scripts.cli import app
from baryscope.study.campaign import begin, campaign, mended, read_plan, run_one
from baryscope.study.campaign.engines import LocalEngine
from baryscope.study.campaign.folder import HEADER, RUNS

COMMAND = [sys.executable, "-m", "baryscope.scripts.cli.app"]


def without_wall(run):
    return {name: value for name, value in run.items() if name != "wall"}


def options(scenario_file, folder, *more, **changed):
    usual = {"scenario": scenario_file, "methods": "screw-gpa,pivot", "draws": 4, "seed": 3, "output": folder} | changed
    return ["campaign", *(f"--{name}={value}" for name, value in usual.items()), *more]


@pytest.fixture(scope="module")
def finished(scenario_file, unit, tmp_path_factory):
    """The folder of a campaign that was carried out here, without a worker."""
    folder = tmp_path_factory.mktemp("campaign") / "one"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LocalEngine, "carry_out", lambda _, cases: (run_one(case) for case in cases))
        assert app.main(options(scenario_file, folder)) == 0
    return folder


def test_the_result_does_not_depend_on_the_number_of_workers(finished, scenario_file, tmp_path, capsys):
    assert app.main(options(scenario_file, tmp_path / "two", "--workers", "2")) == 0
    lines = []
    for folder in (finished, tmp_path / "two"):
        runs = [json.loads(line) for line in (folder / RUNS).read_text(encoding="utf-8").splitlines()]
        lines.append({json.dumps(without_wall(run), sort_keys=True) for run in runs})
        assert len(runs) == 4
    assert lines[0] == lines[1]
    tables = [(folder / "summary.md").read_text(encoding="utf-8") for folder in (finished, tmp_path / "two")]
    without_times = [[line.rsplit("|", 2)[0] for line in table.splitlines()] for table in tables]
    assert without_times[0] == without_times[1]
    assert max(map(len, capsys.readouterr().out.split("NEES should be")[0].splitlines())) <= 90


def copied(finished, folder, lines):
    folder.mkdir()
    (folder / HEADER).write_bytes((finished / HEADER).read_bytes())
    (folder / RUNS).write_bytes(lines)
    return folder


@pytest.fixture
def no_workers(monkeypatch):
    """Runs are carried out here; which ones is told."""
    asked = []

    def here(_, cases):
        for case in cases:
            asked.append(case.number)
            yield run_one(case)

    monkeypatch.setattr(LocalEngine, "carry_out", here)
    return asked


@pytest.mark.parametrize("torn", [b'{"scenario": "small", "ca', b'{"scenario": "sm\n', b"\0\0\0\n"])
def test_a_torn_last_line_is_dropped_and_run_again(finished, scenario_file, tmp_path, no_workers, torn):
    lines = (finished / RUNS).read_bytes().splitlines(keepends=True)
    folder = copied(finished, tmp_path / "torn", b"".join(lines[:2]) + torn)
    assert app.main(options(scenario_file, folder)) == 0
    assert no_workers == [2, 3]
    whole = [without_wall(json.loads(line)) for line in (folder / RUNS).read_text(encoding="utf-8").splitlines()]
    assert whole == [without_wall(json.loads(line)) for line in lines]


def test_what_is_complete_runs_nothing(finished, scenario_file, tmp_path, no_workers, capsys):
    folder = copied(finished, tmp_path / "done", (finished / RUNS).read_bytes())
    assert app.main(options(scenario_file, folder)) == 0
    assert no_workers == []
    assert "nothing to run: 4 runs are there" in capsys.readouterr().err
    assert app.main(["campaign", "--report", "-o", str(folder)]) == 0
    assert "small: a small body, 4 draws" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["--scenario", "envisat"], "scenarios small, expected envisat"),
        (["--methods", "ekf"], "methods screw-gpa,screw-gpa-lvlh,pivot, expected ekf"),
        (["--seed", "77"], "seed "),
        (["--draws", "9"], "draws 4, expected 9"),
        (["--vary", "none"], "expected none"),
    ],
)
def test_a_report_of_other_runs_than_asked_for_is_refused(finished, asked, told, capsys):
    """What is given has to be that of the plan that is there; what is not given may be anything."""
    assert app.main(["campaign", "--report", "-o", str(finished), *asked]) == 2
    error = capsys.readouterr().err
    assert "holds a campaign with " in error
    assert told in error


def test_a_report_of_the_runs_that_are_asked_for(finished, scenario_file, tmp_path, capsys):
    folder = copied(finished, tmp_path / "done", (finished / RUNS).read_bytes())
    assert app.main([*options(scenario_file, folder), "--report"]) == 0
    assert "small: a small body, 4 draws" in capsys.readouterr().out


def test_a_shard_runs_its_own_draws_alone(scenario_file, tmp_path, no_workers, capsys, monkeypatch):
    """And then, in the same folder, those of the other."""
    monkeypatch.chdir(tmp_path)
    words = options(scenario_file, "")[:-1]
    assert app.main([*words, "--shard", "2/2"]) == 0
    assert no_workers == [1, 3]
    assert "2 of 4 runs still missing" in capsys.readouterr().out
    assert app.main([*words, "--shard", "1/2", "-o", "out/campaign-small-2-of-2"]) == 0
    assert no_workers == [1, 3, 0, 2]
    assert "2 runs are there; going on with 2" in capsys.readouterr().err


def test_more_draws_go_on(finished, scenario_file, tmp_path, no_workers):
    folder = copied(finished, tmp_path / "more", (finished / RUNS).read_bytes())
    assert app.main([*options(scenario_file, folder, draws=6)]) == 0
    assert no_workers == [4, 5]
    assert read_plan(folder).draws == 6
    assert app.main(options(scenario_file, folder)) == 0
    assert len(no_workers) == 2


@pytest.mark.parametrize("change, words", [
    ({"seed": 4}, "seed 3, expected 4"),
    ({"methods": "pivot"}, "methods screw-gpa,screw-gpa-lvlh,pivot, expected pivot"),
    ({"vary": "none"}, "vary attitude,anomaly, expected none"),
    ({"scenario": "envisat"}, "scenarios small, expected envisat"),
])  # fmt: skip
def test_other_options_are_refused(finished, scenario_file, no_workers, capsys, change, words):
    before = {path: path.read_bytes() for path in finished.iterdir()}
    assert app.main(options(scenario_file, finished, **change)) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert {path: path.read_bytes() for path in finished.iterdir()} == before
    assert no_workers == []


def test_another_version_or_scenario_is_refused(plan, tmp_path):
    begin(tmp_path / "c", replace(plan, version="0.0.1"), restart=False)
    with pytest.raises(InputError, match=r"version 0\.0\.1, expected "):
        begin(tmp_path / "c", plan, restart=False)
    begin(tmp_path / "c", replace(plan, program="of yesterday"), restart=True)
    with pytest.raises(InputError, match=f"program of yesterday, expected {plan.program}"):
        begin(tmp_path / "c", plan, restart=False)
    entry = plan.entries[0]
    other = replace(plan, entries=(replace(entry, data=entry.data | {"sensor": {"noise": 0.03}}),))
    begin(tmp_path / "d", other, restart=False)
    with pytest.raises(InputError, match="another scenario small"):
        begin(tmp_path / "d", plan, restart=False)


def test_restart_begins_anew(finished, scenario_file, tmp_path, no_workers):
    folder = copied(finished, tmp_path / "again", (finished / RUNS).read_bytes())
    assert app.main(options(scenario_file, folder, "--restart", seed=4, draws=1)) == 0
    assert no_workers == [0]
    assert len((folder / RUNS).read_text(encoding="utf-8").splitlines()) == 1


HOLDING = """
import sys
from baryscope.study.campaign.folder import alone_in
with alone_in(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_another_process_in_the_folder_is_refused(finished, scenario_file, tmp_path, no_workers, plan, capsys):
    """Until it ends, however; also where it would begin anew."""
    folder = copied(finished, tmp_path / "shared", (finished / RUNS).read_bytes())
    before = (folder / RUNS).read_bytes()
    command = [sys.executable, "-c", HOLDING, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        for more in ([], ["--restart"]):
            assert app.main(options(scenario_file, folder, *more, draws=6)) == 2
            words = "found another process that carries out its campaign, expected one at a time"
            assert capsys.readouterr().err == f"baryscope: {folder}: {words}\n"
        with pytest.raises(InputError, match="another process"):
            campaign(plan, folder)
        assert (folder / RUNS).read_bytes() == before
        assert app.main(["campaign", "--report", "-o", str(folder)]) == 0
        other.kill()
    assert app.main(options(scenario_file, folder, draws=6)) == 0
    assert no_workers == [4, 5]


def alive(group):
    """Processes of a group that have not ended, on systems that list them in /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, its_group = path.read_text().rsplit(")", 1)[1].split()[:3]
            if int(its_group) == group and state != "Z":
                found.append(path)
    return found


@contextmanager
def interruptible(command):
    """A process group of its own that an interrupt reaches, also where the tests run behind `&`; none of it is left."""

    def heed():
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=heed
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize("send, number, code, workers", [
    (os.killpg, signal.SIGINT, 130, 1),  # as a terminal's, to each process
    (os.kill, signal.SIGTERM, 143, 2),
    (os.killpg, signal.SIGTERM, 143, 1),
])  # fmt: skip
def test_an_interrupt_keeps_what_is_there(scenario_file, tmp_path, send, number, code, workers):
    """The exit code of the signal, one line that says how to go on, whole lines, no workers left."""
    folder = tmp_path / "cut"
    arguments = options(scenario_file, folder, workers=workers, draws=10_000)
    runs = folder / RUNS
    with interruptible([*COMMAND, *arguments]) as process:
        while process.poll() is None and (not runs.exists() or runs.read_bytes().count(b"\n") < 3):
            time.sleep(0.05)
        send(process.pid, number)
        _, error = process.communicate(timeout=60)
        for _ in range(200):  # the standard library's tracker of resources ends a little later
            if not alive(process.pid):
                break
            time.sleep(0.05)
        assert not alive(process.pid)
    assert process.returncode == code, error
    assert f"kept in {folder}; the same command goes on" in error.splitlines()[-1]
    assert "Traceback" not in error
    plan = read_plan(folder)
    assert mended(folder, plan).count == runs.read_bytes().count(b"\n") >= 3


@pytest.mark.parametrize("spoilt, words", [
    ("not json\n", "line 1 is not the JSON of a run"),
    ('{"scenario": "small", "case": 0}\n', "line 1 is not the JSON of a run"),
    ('{"plan": "IDENTITY", "scenario": "big", "case": 0}\n', "line 1 is of big, draw 0"),
    ('{"plan": "IDENTITY", "scenario": "small", "case": 9}\n', "line 1 is of small, draw 9"),
    ('{"plan": "other", "scenario": "small", "case": 0, "seed": 8}\n', "line 1 is of another plan (other, seed 8)"),
])  # fmt: skip
def test_a_line_that_is_no_run_is_refused(finished, scenario_file, tmp_path, capsys, spoilt, words):
    content = spoilt.replace("IDENTITY", read_plan(finished).identity).encode() + (finished / RUNS).read_bytes()
    folder = copied(finished, tmp_path / "spoilt", content)
    assert app.main(options(scenario_file, folder)) == 2
    assert f"{folder / RUNS}: {words}" in capsys.readouterr().err
    assert (folder / RUNS).read_bytes() == content


@pytest.mark.parametrize("header", ["", "[]", "{", '{"seed": 1}', '{"entries": 3}'])
def test_a_header_that_is_none_is_refused(tmp_path, scenario_file, capsys, header):
    (tmp_path / HEADER).write_text(header, encoding="utf-8")
    for arguments in (["campaign", "--report", "-o", str(tmp_path)], options(scenario_file, tmp_path)):
        assert app.main(arguments) == 2
        error = capsys.readouterr().err
        assert f"{tmp_path / HEADER}" in error
        assert "expected the header of a campaign" in error


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_says_what_is_kept_and_what_to_do(
    finished, scenario_file, tmp_path, no_workers, capsys, monkeypatch
):
    folder = copied(finished, tmp_path / "full", b"".join((finished / RUNS).read_bytes().splitlines(keepends=True)[:1]))
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        assert app.main(options(scenario_file, folder)) == 1
    line = capsys.readouterr().err.splitlines()[-1]
    assert f"{folder / RUNS}: cannot be written (No space left on device); 1 of 4 runs are kept in {folder}" in line
    assert "the same command goes on when there is room" in line
    assert app.main(options(scenario_file, folder)) == 0
    assert mended(folder, read_plan(folder)).count == 4
