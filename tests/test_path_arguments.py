"""Whatever takes a path takes it as text, as a Path, and as anything else that os.fspath understands."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, estimate, write_estimate
from baryscope.fmu import Session, build_fmu, simulate
from baryscope.fmu.check import check_unit
from baryscope.models.scenario import load_orbit, load_scenario, read_toml, write_orbit
from malformed import GOOD_SCENARIO
from synthetic import box_features


class Entry:
    """A path that is neither text nor Path, as os.scandir gives them."""

    def __init__(self, path):
        self._path = os.fspath(path)

    def __fspath__(self):
        return self._path


@pytest.fixture(params=[os.fspath, Path, Entry], ids=["text", "Path", "other"])
def form(request):
    return request.param


@pytest.fixture(scope="module")
def result():
    """An estimate of a body that turns about a point at rest."""
    turn = Rotation.from_rotvec(0.1 * np.arange(20.0)[:, None] * [0.0, 0.6, 0.8]).as_matrix()
    points = box_features(4, (4, 3, 2), seed=1) @ np.swapaxes(turn, 1, 2)
    points += 1e-3 * np.random.default_rng(2).normal(size=points.shape)
    return estimate(FeatureTracks(np.arange(20.0), points, list("abcd")), method="score")


def test_tracks_and_estimate(tmp_path, form, result):
    tracks = FeatureTracks([0.0], np.ones((1, 1, 3)), ["a"])
    tracks.write_csv(form(tmp_path / "tracks.csv"))
    assert FeatureTracks.read_csv(form(tmp_path / "tracks.csv")).labels == ("a",)
    write_estimate(result, form(tmp_path / "est.csv"))
    assert (tmp_path / "est.json").is_file()


def test_scenario_and_orbit(tmp_path, form, envisat):
    (tmp_path / "mine.toml").write_text(GOOD_SCENARIO)
    assert load_scenario(form(tmp_path / "mine.toml")).name == "mine"
    assert read_toml(form(tmp_path / "mine.toml"), "TOML")["description"] == "a small body"
    write_orbit(envisat.orbit, form(tmp_path / "orbit.toml"))
    assert load_orbit(form(tmp_path / "orbit.toml")) == envisat.orbit


def test_unit(tmp_path, form, envisat, envisat_fmu):
    assert build_fmu(envisat, form(tmp_path / "unit.fmu")).read_bytes() == envisat_fmu.read_bytes()
    with Session(form(envisat_fmu)) as session:
        assert session.time == 0
    assert len(simulate(form(envisat_fmu), [0.0, 1.0]).time) == 2
    assert check_unit(form(envisat_fmu), isolated=False) == []


def test_a_path_object_is_never_the_name_of_a_preset(tmp_path, monkeypatch):
    (tmp_path / "envisat").write_text(GOOD_SCENARIO)
    monkeypatch.chdir(tmp_path)
    assert load_scenario(Path("envisat")).description == "a small body"
    assert load_scenario("envisat").description != "a small body"
