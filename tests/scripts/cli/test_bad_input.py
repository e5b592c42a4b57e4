"""Every malformed file, given to the command line: exit code 2, one line, nothing written."""

import pytest

from baryscope.scripts.cli import app
from malformed import GOOD_SCENARIO, ORBITS, SCENARIOS, TRACKS, spoil


def refusal(capsys, tmp_path, *arguments):
    """The one line on standard error; whatever stood in the folder before still stands there alone."""
    before = sorted(tmp_path.iterdir())
    assert app.main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("baryscope: ")
    assert sorted(tmp_path.iterdir()) == before
    return captured.err


@pytest.mark.parametrize("case", TRACKS)
def test_tracks(capsys, tmp_path, case):
    content, mentions = TRACKS[case]
    path = tmp_path / "tracks.csv"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    line = refusal(capsys, tmp_path, "estimate", path, "-o", tmp_path / "out.csv")
    for mention in ["tracks.csv", *mentions]:
        assert mention in line


@pytest.mark.parametrize("command", ["compare", "build", "simulate"])
@pytest.mark.parametrize("replacements, mentions", SCENARIOS)
def test_scenario(capsys, tmp_path, command, replacements, mentions):
    path = tmp_path / "mine.toml"
    path.write_text(spoil(*replacements), encoding="utf-8")
    suffix = {"compare": "", "build": ".fmu", "simulate": ".csv"}[command]
    line = refusal(capsys, tmp_path, command, "--scenario", path, "-o", tmp_path / f"out{suffix}")
    for mention in [str(path), *mentions]:
        assert mention in line


@pytest.mark.parametrize("text, expected", ORBITS)
def test_orbit(capsys, tmp_path, text, expected):
    tracks, orbit = tmp_path / "tracks.csv", tmp_path / "orbit.toml"
    tracks.write_text("time,feature,x,y,z\n0,a,1,2,3\n")
    orbit.write_text(text, encoding="utf-8")
    line = refusal(capsys, tmp_path, "estimate", tracks, "--orbit", orbit, "--axes", "lvlh")
    assert f"{orbit}: {expected}" in line


def test_lvlh_axes_without_an_orbit(capsys, tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("time,feature,x,y,z\n0,a,1,2,3\n")
    assert "needs the target's orbit" in refusal(capsys, tmp_path, "estimate", path, "--axes", "lvlh")


CHOICES = [
    (["--method", "magic"], "--method: found 'magic', expected one of screw-raw"),
    (["--method", "ml", "--lag", "3"], "--lag: found with --method ml, expected one of screw-raw, screw-ls, screw-gpa"),
    (
        ["--axes", "inertial", "--sigma", "0.1"],
        "--sigma: found beside --axes, expected one of the two: no method has both",
    ),
    (["--lag", "2", "--method", "pivot"], "--lag: found with --method pivot, expected one of screw-raw"),
    (["--trajectory", "relative-orbit"], "--trajectory relative-orbit: needs the target's orbit"),
    (["--trajectory", "spline"], "trajectory is 'spline', expected fixed, polynomial, polynomial:N or relative-orbit"),
    (["--trajectory", "polynomial:99"], "expected a degree of 0 to 20"),
    (["--sigma", "0"], "sigma is 0.0, expected a standard deviation of 1e-09 to 1e+09 m"),
    (["--method", "ml", "--torque", "gravity-gradient"], "needs the target's orbit"),
    (["--method", "score", "--trajectory", "polynomial:2"], "expected fixed"),
    (["--torque", "none"], "--torque: found with pivot, the default, expected --method ml or ekf"),
    (["--torque-noise", "1e-9"], "--torque-noise: found with pivot, the default, expected --method ml or ekf"),
    *(
        ([f"--{name}", value, "--method", "score"], f"--{name}: found with --method score, expected one of pivot, ml")
        for name, value in (
            ("sigma", "0.01"),
            ("noise", "fixed"),
            ("process-noise", "none"),
            ("unknown-burns", "none"),
        )
    ),
    (["--torque", "gravity-gradient", "--method", "pivot"], "--torque: found with --method pivot, expected one of ml"),
    (["--torque", "gravity-gradient", "--method", "ekf"], "--torque gravity-gradient: needs the target's orbit"),
    (["--epoch", "foo"], "--epoch: found 'foo'"),
    (["--features", "a"], "--features: found 1 feature, expected at least 2"),
    (["--features", "a,x"], "--features: found 'x', expected some of a"),
    (["--features", "a, a"], "--features: found 'a' twice, expected each feature once"),
    (["--epoch", "2000-06-28"], "--epoch: needs something that has a UTC, expected --orbit ORBIT, --acceler"),
]


@pytest.mark.parametrize("choice, expected", CHOICES)
def test_choices_that_do_not_go_together(capsys, tmp_path, choice, expected):
    path = tmp_path / "tracks.csv"
    path.write_text("time,feature,x,y,z\n0,a,1,2,3\n")
    before = sorted(tmp_path.iterdir())
    assert app.main(["estimate", str(path), *choice]) == 2
    # What only the method can tell comes after the steps that it took to get there.
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("baryscope: ")
    assert expected in line
    assert sorted(tmp_path.iterdir()) == before


def test_no_output_is_an_input(capsys, tmp_path):
    tracks = tmp_path / "tracks.csv"
    tracks.write_text("time,feature,x,y,z\n0,a,1,2,3\n")
    assert "would be written over, but is read" in refusal(capsys, tmp_path, "estimate", tracks, "-o", tracks)
    scenario = tmp_path / "slow.orbit.toml"
    scenario.write_text(GOOD_SCENARIO)
    arguments = ["simulate", "--scenario", scenario, "-o", tmp_path / "slow.csv"]
    assert "would be written over, but is read" in refusal(capsys, tmp_path, *arguments)
    assert scenario.read_text() == GOOD_SCENARIO


@pytest.mark.parametrize("tracks", [".", "", "/"])
def test_a_folder_without_a_name_has_no_tracks(capsys, tmp_path, monkeypatch, tracks):
    monkeypatch.chdir(tmp_path)
    assert "is a folder, expected feature tracks" in refusal(capsys, tmp_path, "estimate", tracks)
