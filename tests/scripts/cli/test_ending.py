"""SIGTERM and SIGINT end a command alike: one line, its own exit code, and nothing is left."""

import os
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from baryscope.scripts.cli import app, scenarios

ROOT = Path(__file__).parents[3]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="SIGTERM ends a process at once")

# As gcc: it has another process do the work, and says that it has begun.
COMPILER = """#!/bin/sh
case "$*" in *--version*) echo slow 1; exit;; esac
sleep 600 &
echo $$ $! > {begun}.new
mv {begun}.new {begun}
wait
"""


def ended(number):
    """Whether a process soon is none any more, or only waits for its parent to ask."""
    for _ in range(200):
        try:
            os.kill(number, 0)
            with open(f"/proc/{number}/stat") as file:  # noqa: PTH123
                if file.read().rsplit(")", 1)[1].split()[0] == "Z":
                    return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


@pytest.mark.parametrize("command, number, code", [
    (["build", "-o", "x.fmu"], signal.SIGTERM, 143),
    (["build", "-o", "x.fmu"], signal.SIGINT, 130),
    (["system", "-o", "x.ssp"], signal.SIGTERM, 143),
    (["fly", "-o", "x"], signal.SIGTERM, 143),
])  # fmt: skip
def test_nothing_is_left(tmp_path, command, number, code):
    """Commands end by one exception, whatever the signal: one of them is tried with both."""
    begun, slow = tmp_path / "begun", tmp_path / "slow-cc"
    slow.write_text(COMPILER.format(begun=begun))
    slow.chmod(0o755)
    folders = {name: tmp_path / name for name in ("here", "temporary", "cache")}
    for folder in folders.values():
        folder.mkdir()
    own = {"CC": str(slow), "TMPDIR": str(folders["temporary"]), "BARYSCOPE_CACHE": str(folders["cache"])}
    with subprocess.Popen(
        [sys.executable, "-m", "baryscope", *command],
        cwd=folders["here"],
        env=os.environ | own,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        compilers = []
        try:
            while process.poll() is None and not begun.exists():
                time.sleep(0.02)
            compilers = [int(word) for word in begun.read_text().split()]
            process.send_signal(number)
            _, error = process.communicate(timeout=60)
            assert all(map(ended, compilers))
        finally:
            process.kill()
            for compiler in compilers:
                with suppress(ProcessLookupError):
                    os.kill(compiler, signal.SIGKILL)
    assert process.returncode == code
    assert error == "baryscope: interrupted; files that were not finished are not there\n"
    assert [path for folder in folders.values() for path in folder.rglob("*")] == []


def sends(number, other=KeyboardInterrupt):
    """A function that is interrupted; a library may make another exception of that."""

    def interrupted(*_, **__):
        try:
            os.kill(os.getpid(), number)
        except KeyboardInterrupt:
            raise other from None
        return []

    return interrupted


@pytest.mark.parametrize("other", [KeyboardInterrupt, NotImplementedError])
@pytest.mark.parametrize("number, code", [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_one_line_whatever_a_library_makes_of_it_and_the_signal_is_as_before(monkeypatch, capsys, number, code, other):
    monkeypatch.setattr(scenarios, "preset_names", sends(number, other))
    usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    before = signal.signal(number, usual)  # tests in the background ignore SIGINT
    try:
        assert app.main(["scenarios"]) == code
        assert signal.getsignal(number) is usual
    finally:
        signal.signal(number, before)
    assert capsys.readouterr().err == "baryscope: interrupted; files that were not finished are not there\n"


def test_whoever_has_another_use_for_the_signal_keeps_it(monkeypatch):
    monkeypatch.setattr(scenarios, "preset_names", sends(signal.SIGTERM))
    heard = []
    before = signal.signal(signal.SIGTERM, lambda number, _: heard.append(number))
    try:
        assert app.main(["scenarios"]) == 0
    finally:
        signal.signal(signal.SIGTERM, before)
    assert heard == [signal.SIGTERM]


INTERRUPTED_AT = """
import runpy, sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "cyclopts":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupt())
"""
WAYS = {
    "python -m": "runpy.run_module('baryscope', run_name='__main__')",
    "the installed command": "from baryscope.__main__ import run; sys.exit(run())",
}


@pytest.mark.parametrize("way", WAYS)
def test_an_interrupt_while_the_libraries_are_loaded(way):
    command = [sys.executable, "-c", INTERRUPTED_AT + WAYS[way], "scenarios"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr == "baryscope: interrupted\n"


def test_the_installed_command_is_that_of_the_package():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    assert scripts == {"baryscope": "baryscope.__main__:run"}
