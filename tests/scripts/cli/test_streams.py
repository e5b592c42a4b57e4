"""Standard streams that lack characters, or are not there."""

import errno
import json
import os
import subprocess
import sys

import pytest

posix = pytest.mark.skipif(sys.platform == "win32", reason="of POSIX systems")
BARYSCOPE = [sys.executable, "-m", "baryscope"]
WITHOUT_UTF8 = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize("variables", [{"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "cp1252"}, WITHOUT_UTF8])
def test_characters_that_standard_output_lacks(variables):
    """They are replaced for people, and escaped in JSON."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONIOENCODING"} | variables
    text, data = (
        subprocess.run([*BARYSCOPE, "scenarios", *more], env=environment, capture_output=True, check=False)
        for more in ([], ["--json"])
    )
    for done in (text, data):
        assert done.returncode == 0
        assert done.stderr == b""
    assert b"envisat" in text.stdout
    assert b"?/s" in text.stdout or "°/s".encode("cp1252") in text.stdout
    assert any("°/s" in preset["description"] for preset in json.loads(data.stdout))


def test_what_the_user_wants_of_such_characters():
    environment = os.environ | {"PYTHONIOENCODING": "ascii:backslashreplace"}
    done = subprocess.run([*BARYSCOPE, "scenarios"], env=environment, capture_output=True, check=False)
    assert b"\\xb0/s" in done.stdout


def closed(number, *arguments, **options):
    """Run a command without one of its standard streams."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.run(
        [*BARYSCOPE, *arguments], preexec_fn=lambda: os.close(number), text=True, check=False, **pipes, **options
    )


@posix
@pytest.mark.parametrize("arguments", [["scenarios"], ["scenarios", "--json"], ["--help"], ["--version"]])
def test_standard_output_that_is_closed(arguments):
    done = closed(1, *arguments)
    assert done.returncode == 1
    assert done.stderr == f"baryscope: standard output: cannot be written ({os.strerror(errno.EBADF)})\n"


@posix
def test_standard_error_that_is_closed(tmp_path):
    """An error does not go to standard output instead."""
    done = closed(2, "estimate", "nope.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    done = closed(2, "scenarios")
    assert done.returncode == 0
    assert "envisat" in done.stdout


@posix
def test_a_current_folder_that_is_gone(tmp_path):
    """Which is not the fault of standard output."""
    folder = tmp_path / "gone"
    folder.mkdir()
    program = "import os, sys; os.rmdir(os.getcwd()); from baryscope.__main__ import run; sys.exit(run())"
    command = [sys.executable, "-c", program, "estimate", "t.csv"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "baryscope: the current folder: is not there any more, expected one that is\n"


@pytest.mark.parametrize("arguments", [["scenarios"], ["--help"]])
def test_a_width_of_no_columns_is_none(arguments):
    printed = []
    for columns in ("0", "80"):
        own = os.environ | {"COLUMNS": columns}
        done = subprocess.run([*BARYSCOPE, *arguments], env=own, capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (0, b"")
        printed.append(done.stdout)
    assert printed[0] == printed[1]
