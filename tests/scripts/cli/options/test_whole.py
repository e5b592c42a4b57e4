"""Options that are whole numbers take no others."""

import pytest

from baryscope.scripts.cli import app
from baryscope.scripts.cli.options.whole import Whole

WHOLE = {
    ("campaign", "--draws"),
    ("campaign", "--seed"),
    ("campaign", "--workers"),
    ("estimate", "--degree"),
    ("track", "--features"),
}
ARGUMENTS = {
    "campaign": ["-o", "c"],
    "estimate": ["t.csv"],
    "track": ["left", "right", "--rig", "rig.toml", "-o", "t.csv"],
}


def options():
    for name in app.COMMANDS:
        for argument in app.app[name].assemble_argument_collection():
            if argument.hint in (int, int | None):
                yield name, argument.names[0], argument


def test_all_options_that_are_whole_numbers_are_told():
    assert {(name, option) for name, option, _ in options()} == WHOLE
    (parameter,) = Whole.__metadata__
    for *_, argument in options():
        assert argument.parameter.converter is parameter.converter


@pytest.mark.parametrize("value", ["2.5", "12.7", "two", "1e3", ""])
@pytest.mark.parametrize("command, option", sorted(WHOLE))
def test_others_are_refused(capsys, tmp_path, monkeypatch, command, option, value):
    monkeypatch.chdir(tmp_path)
    assert app.main([command, *ARGUMENTS[command], f"{option}={value}"]) == 2
    assert capsys.readouterr().err == f"baryscope: {option}: found {value!r}, expected a whole number\n"
    assert list(tmp_path.iterdir()) == []
