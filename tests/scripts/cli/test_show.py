"""What every command shares: --json, --quiet, shell completion."""

import io
import json
import shutil
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from baryscope import __version__
from baryscope.models.scenario import preset_names
from baryscope.scripts.cli import app, console
from baryscope.study.campaign import run_one
from baryscope.study.campaign.engines import LocalEngine
from baryscope.study.images.scene import rig_text, write_images
from joints import both_bodies
from malformed import GOOD_SCENARIO
from pictures import scene

COMMANDS = sorted(name for name in app.app if not name.startswith("-"))
PRECISE = GOOD_SCENARIO.replace("noise = 0.02", "noise = 0.002")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Small inputs for every command: a scenario, tracks with truth and orbit, a unit, images."""
    pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")
    folder = tmp_path_factory.mktemp("small")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("mine.toml").write_text(PRECISE, encoding="utf-8")
        assert app.main(["build", "--scenario", "mine.toml", "-o", "mine.fmu"]) == 0
        assert app.main(["simulate", "--scenario", "mine.toml", "--fmu", "mine.fmu", "-o", "mine.csv"]) == 0
        both_bodies(1).write_csv("recorded.csv")
        write_images(pictured := scene(9), folder)
        Path("rig.toml").write_text(rig_text(pictured), encoding="utf-8")
    return folder


ARGUMENTS = {  # systems are of envisat, whose filter is compiled for other tests, too
    "bound": ["--scenario", "mine.toml", "--durations", "50,100"],
    "build": ["--scenario", "mine.toml", "-o", "other.fmu"],
    "campaign": ["--scenario", "mine.toml", "--methods", "pivot", "--draws", "2", "--workers", "1", "-o", "campaign"],
    "check": ["mine.fmu"],
    "compare": ["--scenario", "mine.toml", "--methods", "pivot,screw-gpa", "-o", "compared"],
    "estimate": ["mine.csv", "--orbit", "mine.orbit.toml"],
    "figures": ["--scenario", "mine.toml", "-o", "figures"],
    "fly": ["--scenario", "envisat", "--duration", "60", "-o", "flown"],
    "joint": ["recorded.csv", "--parent", "pa,pb,pc,pd", "--child", "ca,cb,cc,cd"],
    "scenarios": [],
    "simulate": ["--scenario", "mine.toml", "--fmu", "mine.fmu", "-o", "other.csv"],
    "system": ["--scenario", "envisat", "-o", "chain.ssp"],
    "track": ["left", "right", "--rig", "rig.toml", "--rate", "1", "-o", "followed.csv"],
}


def test_every_command_is_tested():
    assert sorted(ARGUMENTS) == COMMANDS


@pytest.fixture(scope="module")
def documents(folder):
    """What each command gives with --json --quiet: a document, and its standard error. The campaign is carried out
    here: a worker takes longer to start.
    """
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(LocalEngine, "carry_out", lambda _, cases: (run_one(case) for case in cases))
        for command, arguments in ARGUMENTS.items():
            out, err = io.StringIO(), io.StringIO()
            with redirect_stdout(out), redirect_stderr(err):
                assert app.main([command, *arguments, "--json", "--quiet"]) == 0
            found[command] = json.loads(out.getvalue()), err.getvalue()
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_the_result_is_one_document_and_quiet_is_quiet(documents, command):
    document, remarks = documents[command]
    assert remarks == ""
    if command != "scenarios":
        assert document["version"] == __version__


def test_the_documents_hold_the_results(documents, folder):
    found = {command: document for command, (document, _) in documents.items()}
    assert [preset["name"] for preset in found["scenarios"]] == list(preset_names())
    assert found["check"]["findings"] == []
    assert found["build"]["bytes"] == (folder / "other.fmu").stat().st_size
    assert (folder / found["simulate"]["orbit"]).read_bytes() == (folder / "mine.orbit.toml").read_bytes()
    assert found["simulate"]["frames"] == 101
    assert found["estimate"] == json.loads((folder / "mine.estimate.json").read_text(encoding="utf-8"))
    assert found["system"]["bytes"] == (folder / "chain.ssp").stat().st_size
    assert found["fly"]["samples"] == json.loads((folder / "flown" / "flight.json").read_text())["samples"] > 0
    assert [row["duration"] for row in found["bound"]["variants"]] == [50, 100]
    assert found["bound"]["variants"][1]["path_rmse"] < 0.01
    pivot, inertial, lvlh = found["compare"]["methods"]
    assert pivot["rmse"] < 5 * found["compare"]["cramer_rao_bound"]["rmse"]
    assert (inertial["axes"], lvlh["axes"], lvlh["predicted_rmse"]) == ("inertial", "lvlh", None)
    scenario = found["campaign"]["scenarios"][0]
    assert (found["campaign"]["runs"], scenario["draws"], scenario["methods"][0]["method"]) == (2, 2, "pivot")
    assert scenario["methods"][0]["rmse"] < 5 * scenario["crb"]


def test_quiet_leaves_the_result_and_the_errors(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert app.main(["simulate", "--scenario", "mine.toml", "--fmu", "mine.fmu", "-o", "third.csv", "-q"]) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    assert shown.out.startswith("third.csv: ")
    assert app.main(["estimate", "none.csv", "--quiet"]) == 2
    assert capsys.readouterr().err.startswith("baryscope: none.csv: ")


def test_long_work_tells_its_share_and_the_time_left_where_there_is_no_terminal(monkeypatch, capsys):
    monkeypatch.setattr(console, "TELL_EVERY", 0.0)
    clock = iter([0.0, 0.0, 10.0, 400.0])
    monkeypatch.setattr(console.time, "perf_counter", lambda: next(clock))
    with console.Show().progress() as progress:
        progress("long work", 0.0)
        progress("long work", 0.02)
        progress("long work", 1.0)
    assert capsys.readouterr().err.splitlines() == ["  long work: 2 %, about 8 min left", "long work: 400.00 s"]


@pytest.fixture(scope="module")
def completion(tmp_path_factory):
    """bash's completion, installed as the README says, in a home of its own."""
    home = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(home))
        assert app.main(["--install-completion", "--shell", "bash"]) == 0
    assert (home / ".bashrc").is_file()
    return next(path for path in home.rglob("*baryscope*") if path.is_file())


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize("words, expected", [
    (["baryscope", "est"], ["estimate"]),
    (["baryscope", "c"], ["campaign", "check", "compare"]),
    (["baryscope", "estimate", "--traj"], ["--trajectory"]),
    (["baryscope", "build", "--platforms", "w"], ["wasm"]),
])  # fmt: skip
def test_the_shell_completes_commands_options_and_choices(completion, words, expected):
    program = (
        f"source {completion}; COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; "
        "$(complete -p baryscope | sed 's/.*-F \\([^ ]*\\).*/\\1/'); printf '%s\\n' \"${COMPREPLY[@]}\""
    )
    done = subprocess.run([shutil.which("bash"), "-c", program], capture_output=True, text=True, check=True)
    assert sorted(line.strip() for line in done.stdout.splitlines()) == expected
