"""`baryscope track`: what it prints and writes, and what it refuses."""

import json

import pytest

from baryscope.estimator import FeatureTracks
from baryscope.estimator.images import opencv
from baryscope.scripts.cli import app
from baryscope.study.images.scene import rig_text, write_images
from pictures import scene

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

FRAMES = 9
HEAD = ["track", "left", "right"]
RIG, OUT = ["--rig", "rig.toml"], ["-o", "tracks.csv"]


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    folder = tmp_path_factory.mktemp("images")
    write_images(scene(FRAMES), folder)
    (folder / "rig.toml").write_text(rig_text(scene(FRAMES)), encoding="utf-8")
    (folder / "times.csv").write_text("time\n" + "\n".join(f"{2 * k}" for k in range(FRAMES)), encoding="utf-8")
    (folder / "late.csv").write_text("time\n1\n3\n2\n", encoding="utf-8")
    return folder


@pytest.fixture
def here(images, monkeypatch):
    monkeypatch.chdir(images)
    return images


def test_tracks_are_written(here, capsys):
    assert app.main([*HEAD, *RIG, *OUT, "--times", "times.csv", "--features", "30", "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    tracks = FeatureTracks.read_csv(here / "tracks.csv")
    assert tracks.time.tolist() == [2.0 * k for k in range(FRAMES)]
    assert tracks.covariance is not None
    assert [found["frames"], found["observations"]] == [FRAMES, tracks.seen.sum()]
    assert found["features"] == len(tracks.labels) <= found["features_found"]
    assert 5 < tracks.seen.sum(axis=1).max() <= 30
    assert not list(here.glob(".tracks*"))


@pytest.mark.parametrize("arguments, words", [
    ([*RIG, *OUT, "--rate", "0"], "rate: found 0 Hz, expected a number above 0"),
    ([*RIG, *OUT], "left: does not tell the images' times, expected a rate or times"),
    ([*RIG, *OUT, "--rate", "2", "--times", "times.csv"], "--rate: found beside --times"),
    ([*RIG, *OUT, "--times", "late.csv"], "late.csv, line 4, column time: not after the row before"),
    ([*RIG, *OUT, "--rate", "2", "--features", "3"], "features: found 3, expected 8 to 1000"),
    (["--rig", "times.csv", *OUT, "--rate", "2"], "times.csv: Expected"),
    ([*RIG, "--rate", "2", "-o", "tracks.txt"], "tracks.txt: ends in '.txt'"),
    (["--rate", "2", "-o", "times.csv", "--rig", "times.csv"], "times.csv: would be written over, but is read"),
])  # fmt: skip
def test_what_is_wrong_is_one_line(here, capsys, arguments, words):
    assert app.main([*HEAD, *arguments, "-q"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_a_missing_extra_is_named(here, capsys, monkeypatch):
    monkeypatch.setattr(opencv, "find_spec", lambda name: None)
    assert app.main([*HEAD, *RIG, *OUT, "--rate", "2", "-q"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'baryscope[images]'" in line
