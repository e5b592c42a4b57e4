"""No command writes over a file that it reads, by whatever name, or works for files that cannot be written.

Exit code 2, one line, before any work.
"""

import os
from importlib.resources import files
from pathlib import Path

import pytest

from baryscope.scripts.cli import app
from malformed import GOOD_SCENARIO

TRACKS = "time,feature,x,y,z\n0,a,1,2,3\n"
ORBIT = "[orbit]\nsemi_major_axis = 7.15e6\neccentricity = 0\ninclination_deg = 98\n"


def symlink(target, name):
    name.symlink_to(target)


def hard_link(target, name):
    os.link(target, name)


SUITE = (files("baryscope.study") / "campaign" / "suites" / "reach.toml").read_text(encoding="utf-8")
TO_FOLDER = ["--scenario", "{in}", "-o", "{folder}"]

# A command's arguments, with {in} for a file that it reads and {folder} for the one that it writes to; the name of a
# file that it writes; and the text of the file that it reads.
WRITES = {
    "estimate, tracks": (["estimate", "{in}", "-o", "{folder}/est.csv"], "est.csv", TRACKS),
    "estimate, tracks by default": (["estimate", "{in}"], "{in}.estimate.csv", TRACKS),
    "estimate, diagnostics over the tracks": (["estimate", "{in}", "-o", "{folder}/est.csv"], "est.json", TRACKS),
    "estimate, report over the tracks": (["estimate", "{in}", "-o", "{folder}/est.csv"], "est.report.html", TRACKS),
    "estimate, over the orbit": (
        ["estimate", "{folder}/other.csv", "--orbit", "{in}", "-o", "{folder}/est.csv"], "est.json", ORBIT
    ),
    "simulate, tracks": (["simulate", "--scenario", "{in}", "-o", "{folder}/t.csv"], "t.csv", GOOD_SCENARIO),
    "simulate, truth": (["simulate", "--scenario", "{in}", "-o", "{folder}/t.csv"], "t.truth.csv", GOOD_SCENARIO),
    "simulate, orbit": (["simulate", "--scenario", "{in}", "-o", "{folder}/t.csv"], "t.orbit.toml", GOOD_SCENARIO),
    "simulate, over the unit": (["simulate", "--fmu", "{in}", "-o", "{folder}/t.csv"], "t.csv", "PK"),
    "build, unit": (["build", "--scenario", "{in}", "-o", "{folder}/u.fmu"], "u.fmu", GOOD_SCENARIO),
    "build, table of variables": (
        ["build", "--platforms", "wasm", "--scenario", "{in}", "-o", "{folder}/u.wasm"], "u.json", GOOD_SCENARIO
    ),
    "compare, tracks": (["compare", *TO_FOLDER], "tracks.csv", GOOD_SCENARIO),
    "compare, orbit": (["compare", *TO_FOLDER], "tracks.orbit.toml", GOOD_SCENARIO),
    "compare, unit": (["compare", *TO_FOLDER], "TumblingTarget.fmu", GOOD_SCENARIO),
    "compare, estimate": (["compare", *TO_FOLDER], "screw-gpa-lvlh.json", GOOD_SCENARIO),
    "compare, report": (["compare", *TO_FOLDER], "report.html", GOOD_SCENARIO),
    "compare, picture": (["compare", *TO_FOLDER], "comparison.png", GOOD_SCENARIO),
    "compare, summary": (["compare", *TO_FOLDER], "summary.md", GOOD_SCENARIO),
    "bound, table": (["bound", *TO_FOLDER], "bound.csv", GOOD_SCENARIO),
    "bound, page": (["bound", *TO_FOLDER], "bound.md", GOOD_SCENARIO),
    "bound, picture": (["bound", *TO_FOLDER], "bound-of-a-rig.png", GOOD_SCENARIO),
    "campaign, header": (["campaign", *TO_FOLDER], "campaign.json", GOOD_SCENARIO),
    "campaign, runs": (["campaign", *TO_FOLDER], "runs.jsonl", GOOD_SCENARIO),
    "campaign, table": (["campaign", *TO_FOLDER], "runs.parquet", GOOD_SCENARIO),
    "campaign, summary": (["campaign", *TO_FOLDER], "summary.md", GOOD_SCENARIO),
    "campaign, report": (["campaign", *TO_FOLDER], "report.html", GOOD_SCENARIO),
    "campaign, over the suite": (["campaign", "--suite", "{in}", "-o", "{folder}"], "summary.md", SUITE),
}  # fmt: skip


def contents(folder):
    """All files by name, links as what they show."""
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_refused(capsys, tmp_path, arguments, name):
    before = contents(tmp_path)
    assert app.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith(f"baryscope: {name}: would be written over, but is read")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("link", [symlink, hard_link])
@pytest.mark.parametrize("case", WRITES)
def test_links(capsys, tmp_path, case, link):
    arguments, written, text = WRITES[case]
    folder = tmp_path / "out"
    folder.mkdir()
    suffix = {TRACKS: ".csv", "PK": ".fmu"}.get(text, ".toml")
    read = tmp_path / f"mine{suffix}"
    read.write_text(text, encoding="utf-8")
    name = read.with_suffix(".estimate.csv") if written.startswith("{in}") else folder / written
    link(read, name)
    assert_refused(capsys, tmp_path, [part.format(**{"in": read, "folder": folder}) for part in arguments], name)


# Commands with nothing above; of what they read none is there, which they would say if they went on to read.
UNREAD = {
    "fly": ["fly", "none.ssp", "-o", "{folder}"],
    "joint": ["joint", "none.csv", "--child", "a,b,c", "-o", "{folder}/joint.csv"],
    "track": ["track", "none.mp4", "none.avi", "--rig", "none.toml", "-o", "{folder}/tracks.csv"],
    "system": ["system", "-o", "{folder}/chain.ssp"],
    "figures": ["figures", "-o", "{folder}"],
}
TO_FOLDERS = UNREAD | {case: one[0] for case, one in WRITES.items() if "{folder}" in " ".join(one[0])}


@pytest.mark.parametrize("below", ["", "new/newer"])
@pytest.mark.parametrize("case", TO_FOLDERS)
def test_a_file_in_the_way_of_a_folder(capsys, tmp_path, case, below):
    text = WRITES[case][2] if case in WRITES else ""
    read, blocked = tmp_path / f"mine{ {TRACKS: '.csv', 'PK': '.fmu'}.get(text, '.toml') }", tmp_path / "out"
    read.write_text(text, encoding="utf-8")
    blocked.write_text("mine")
    before = contents(tmp_path)
    named = {"in": read, "folder": blocked / below}
    assert app.main([part.format(**named) for part in TO_FOLDERS[case]]) == 2
    captured = capsys.readouterr()
    assert captured.err == f"baryscope: {blocked}: is a file, expected a folder to write to\n"
    assert captured.out == ""
    assert contents(tmp_path) == before


@pytest.mark.parametrize("case", UNREAD)
def test_a_folder_that_is_read_only(capsys, tmp_path, monkeypatch, case):
    """Root may write anywhere, so that the answer of the system is given here."""
    monkeypatch.setattr("baryscope.models.files.os.access", lambda folder, _: Path(folder) != tmp_path)
    assert app.main([part.format(folder=tmp_path / "out") for part in UNREAD[case]]) == 2
    captured = capsys.readouterr()
    assert f": cannot be written, as {tmp_path} is a folder that is read-only\n" in captured.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("read, written, text, arguments", [
    ("x.csv", "x.csv", TRACKS, ["estimate", "x.csv", "-o", "x.csv"]),
    ("x.csv", "./x.csv", TRACKS, ["estimate", "x.csv", "-o", "./x.csv"]),
    ("x.csv", "../{here}/x.csv", TRACKS, ["estimate", "x.csv", "-o", "../{here}/x.csv"]),
    ("x.orbit.toml", "x.orbit.toml", GOOD_SCENARIO, ["simulate", "--scenario", "x.orbit.toml", "-o", "x.csv"]),
    ("x.truth.csv", "x.truth.csv", GOOD_SCENARIO, ["simulate", "--scenario", "../{here}/x.truth.csv", "-o", "x.csv"]),
    ("tracks.csv", "tracks.csv", GOOD_SCENARIO, ["compare", "--scenario", "../{here}/tracks.csv", "-o", "."]),
    ("campaign.json", "campaign.json", GOOD_SCENARIO, ["campaign", "--scenario", "../{here}/campaign.json", "-o", "."]),
    ("summary.md", "summary.md", SUITE, ["campaign", "--suite", "../{here}/summary.md", "-o", "."]),
    ("bound.md", "bound.md", GOOD_SCENARIO, ["bound", "--scenario", "../{here}/bound.md", "-o", "."]),
])  # fmt: skip
def test_names(capsys, tmp_path, monkeypatch, read, written, text, arguments):
    monkeypatch.chdir(tmp_path)
    (tmp_path / read).write_text(text, encoding="utf-8")
    arguments = [part.format(here=tmp_path.name) for part in arguments]
    assert_refused(capsys, tmp_path, arguments, Path(written.format(here=tmp_path.name)))


def test_check_writes_nothing(capsys, tmp_path, envisat_fmu, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "unit.fmu").write_bytes(envisat_fmu.read_bytes())
    before = contents(tmp_path)
    assert app.main(["check", "unit.fmu"]) == 0
    assert contents(tmp_path) == before


def test_a_scenario_beside_what_is_written_is_no_obstacle(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(GOOD_SCENARIO, encoding="utf-8")
    assert app.main(["bound", "--scenario", "mine.toml", "--table", "--durations", "50,100", "-o", "."]) == 0
    assert app.main(["simulate", "--scenario", "mine.toml"]) == 0
    assert {"mine.toml", "mine.csv", "bound.csv"} <= {path.name for path in tmp_path.iterdir()}
