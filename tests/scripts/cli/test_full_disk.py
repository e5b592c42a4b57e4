"""A disk that is full, played by a limit on the size of files: one line, and no half of a file."""

import errno
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from baryscope.models.errors import DiskError
from baryscope.scripts.cli import app
from baryscope.study.campaign import folder as campaign_folder
from malformed import GOOD_SCENARIO

resource = pytest.importorskip("resource")

LIMITED = """
import resource, sys
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
from baryscope.scripts.cli import app
sys.exit(app.main(sys.argv[2:]))
"""
REASON = os.strerror(errno.EFBIG)


@contextmanager
def limited(size):
    """No file may be larger than so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def in_process(limit, words):
    """Run a command in a process of its own that can write no file of more than `limit` bytes."""
    command = [sys.executable, "-c", LIMITED, str(limit), *words]
    own = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, env=own, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr.splitlines()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD_SCENARIO, encoding="utf-8")
    return tmp_path


COMMANDS = {
    "build": (10_000, ["build", "-o", "u.fmu"], "u.fmu"),
    "simulate, tracks": (1_000_000, ["simulate", "--fmu", "{unit}", "-o", "t.csv"], "t.csv"),
    "simulate, unpacking": (1_000, ["simulate", "--fmu", "{unit}", "-o", "t.csv"], "baryscope."),
    "estimate": (1_000, ["estimate", "{tracks}", "--trajectory", "fixed", "-o", "e.csv"], "e.csv"),
    "estimate, NetCDF": (5_000, ["estimate", "{tracks}", "--trajectory", "fixed", "-o", "e.nc"], "e.nc"),
    "bound": (100, ["bound", "--scenario", "mine.toml", "--durations", "50,100", "-o", "b"], "b/bound"),
    "compare, compiling": (10_000, ["compare", "--scenario", "mine.toml", "-o", "c"], "for temporary files"),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_one_line_names_the_file_and_the_reason(case, folder, envisat_fmu, tmp_path_factory, monkeypatch, capsys):
    """All but NetCDF's run here, where nothing has to be imported: its library may keep a file that it cannot write."""
    limit, arguments, name = COMMANDS[case]
    tracks = tmp_path_factory.mktemp("given") / "tracks.csv"
    rows = (f"{k},F{i},{i % 2 + 1e-3 * k},{i % 3},{i}" for k in range(20) for i in range(4))
    tracks.write_text("\n".join(["time,feature,x,y,z", *rows]) + "\n")
    given = {"unit": envisat_fmu, "tracks": tracks}
    words = [part.format(**given) for part in arguments]
    monkeypatch.chdir(folder)
    if "compiling" in case:
        monkeypatch.setenv("BARYSCOPE_CACHE", str(folder / ".cache"))
    if "NetCDF" in case:
        code, lines = in_process(limit, words)
    else:
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        with limited(limit):
            code = app.main(words)
        lines = capsys.readouterr().err.splitlines()
    assert code == 1
    complaints = [line for line in lines if line.startswith("baryscope: ")]
    assert lines[-1:] == complaints
    assert name in complaints[0]
    assert f"cannot be written ({REASON})" in complaints[0]
    left = {path.name for path in folder.rglob("*") if path.is_file()}
    assert left == {"mine.toml"}


def test_a_run_that_is_torn_is_not_counted(tmp_path):
    """A write may take some of the bytes, and only the next one fails."""
    run = {"scenario": "a", "case": 0, "bound": {}, "methods": {}, "wall": {}, "text": "x" * 1000}
    with campaign_folder.RunFile(tmp_path) as file:
        file.append(run)
        size = (tmp_path / campaign_folder.RUNS).stat().st_size
        with limited(size + 10), pytest.raises(DiskError, match=r"runs\.jsonl: cannot be written"):
            file.append(run)
    assert (tmp_path / campaign_folder.RUNS).stat().st_size == size + 10


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("arguments", [["scenarios"], ["--help"]])
def test_standard_output_that_is_full(arguments):
    """As `baryscope scenarios > file` on a full disk."""
    command = [sys.executable, "-m", "baryscope", *arguments]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == f"baryscope: standard output: cannot be written ({os.strerror(errno.ENOSPC)})\n"
