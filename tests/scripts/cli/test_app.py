"""The command line as a user meets it: exit codes, one line for an error, nothing half written."""

import re
import subprocess
import sys

import pytest

from baryscope import __version__
from baryscope.models.scenario import preset_names
from baryscope.scripts.cli import app, scenarios


def complaint(capsys, code, *arguments):
    """Run the command line, expect this exit code and one line on standard error, and return the line."""
    assert app.main(list(map(str, arguments))) == code
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("baryscope: ")
    assert captured.out == ""
    return lines[0]


COMMANDS = sorted(name for name in app.app if not name.startswith("-"))


@pytest.mark.parametrize("arguments", [[], ["-h"], ["--help"]])
def test_help_names_every_command_with_what_it_does(capsys, monkeypatch, arguments):
    """In the first line of what its own help says, which is that of its docstring."""
    monkeypatch.setenv("COLUMNS", "200")
    assert {"compare", "build", "simulate", "estimate", "campaign", "bound", "check", "scenarios"} <= set(COMMANDS)
    assert app.main(arguments) == 0
    text = capsys.readouterr().out
    for command in COMMANDS:
        purpose = app.app[command].help.partition("\n")[0].replace("`", "")
        assert re.search(rf"\b{command}\s+{re.escape(purpose)}", text), command


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_describes_every_option(capsys, command):
    assert app.main([command, "--help"]) == 0
    text = capsys.readouterr().out
    arguments = [
        one for one in app.app[command].assemble_argument_collection(parse_docstring=True) if one.names != ("*",)
    ]
    assert arguments
    for argument in arguments:
        assert argument.names[0] in text
        assert argument.parameter.help, argument.names


def test_version(capsys):
    assert app.main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == __version__


LOADED = """
import sys
from baryscope.scripts.cli.app import main
main(sys.argv[1:])
print(*sys.modules, file=sys.stderr)
"""


def loaded_by(*arguments):
    """The modules in a process that has run the command line."""
    done = subprocess.run([sys.executable, "-c", LOADED, *arguments], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


def test_a_command_loads_what_it_needs():
    """Nobody wants to wait for all libraries who asks for the version, or for what commands there are."""
    libraries = {"numpy", "casadi", "baryscope.fmu", "baryscope.estimator", "baryscope.study"}
    for arguments in (["--version"], ["--help"], []):
        assert not loaded_by(*arguments) & libraries
    assert not loaded_by("build", "--help") & {"scipy", "baryscope.estimator", "baryscope.study"}
    slow = {f"scipy.{name}" for name in ("stats", "signal", "interpolate", "ndimage", "optimize", "sparse", "spatial")}
    assert not loaded_by("estimate", "--help") & slow
    assert not loaded_by("campaign", "--help") & {*slow, "polars"}  # nor do workers: they load a part of this


def test_scenarios_has_a_line_for_each_preset(capsys):
    assert app.main(["scenarios"]) == 0
    text = capsys.readouterr().out
    for name in preset_names():
        assert name in text


@pytest.mark.parametrize("arguments, words", [
    (["flie"], "fly"),
    (["estimate"], "estimate: TRACKS is missing, expected this argument"),
    (["track", "a", "b", "-o", "t.csv"], "track: --rig is missing, expected this argument"),
    (["joint", "x.csv", "--child"], "--child requires an argument"),
    (["track", "a", "b", "-o", "t.csv", "--rigg", "r.toml"], "Did you mean --rig instead of --rigg?"),
    (["estimate", "x.csv", "--method", "magic"], "magic"),
    (["estimate", "x.csv", "--lag", "long"], "--lag: found 'long', expected "),
    (["estimate", "x.csv", "--sigma", "2cm"], "--sigma: found '2cm', expected a number"),
    (["estimate", "x.csv", "--sigma", "0,02"], "--sigma: found '0,02', expected a number"),
    (["estimate", "x.csv", "--process-noise", "much"], "found 'much', expected auto, none, or a number"),
    (["campaign", "--draws", "2.5"], "--draws: found '2.5', expected a whole number"),
    (["fly", "chain.ssp", "--duration", "20s"], "--duration: found '20s', expected a number"),
    (["estimate", "my", "tracks.csv"], "estimate: found 'tracks.csv' too many, expected quotes around names with"),
    (["joint", "x.csv", "--child", "a", "b"], "joint: found 'b' too many, expected quotes around names with blanks"),
    (["compare", "--methods", "screw-gpa,magic"], "methods: found 'magic', expected some of screw-raw"),
    (["compare", "--methods", ","], "found none"),
    (["compare", "--scenario", "mir"], "'mir': not a preset, expected one of"),
    (["build", "--colour", "red"], "--colour"),
    (["build", "-o", "unit.zip"], "'.zip', expected .fmu"),
    (["simulate", "-o", "tracks.xls"], "'.xls', expected .csv"),
    (["estimate", "tracks.txt"], "'.txt', expected one of .csv, .parquet"),
    (["simulate", "--fmu", "none.fmu", "-o", "x.csv"], "none.fmu: No such file"),
])  # fmt: skip
def test_wrong_arguments_exit_with_2(capsys, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert words in complaint(capsys, 2, *arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_of_the_folder(capsys, tmp_path):
    path = tmp_path / "out"
    path.write_text("mine")
    assert "is a file, expected a folder" in complaint(capsys, 2, "compare", "-o", path)
    assert path.read_text() == "mine"


def test_an_interrupt_is_one_line(capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(scenarios, "preset_names", interrupted)
    assert "interrupted" in complaint(capsys, 130, "scenarios")


def test_an_unforeseen_error_is_one_line_unless_debugging(capsys, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("oh\nno")

    monkeypatch.setattr(app, "app", broken)
    assert "internal error, ZeroDivisionError: oh no" in complaint(capsys, 1, "scenarios")
    monkeypatch.setenv("BARYSCOPE_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        app.main(["scenarios"])


def test_the_installed_command_exits_with_the_code(tmp_path):
    command = [sys.executable, "-m", "baryscope.scripts.cli.app", "estimate", str(tmp_path / "none.csv")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert result.stdout == ""
    assert "none.csv: No such file" in result.stderr
