"""From rendered images to the centre of mass and its covariance; the table of the study, and the files of a draw."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter
from scipy.stats import chi2

from baryscope.estimator import PathOptions, estimate
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import load_pair
from baryscope.estimator.images import track
from baryscope.models.scenario import load_orbit
from baryscope.study.images import __main__ as command
from baryscope.study.images.picture import picture, trails
from baryscope.study.images.report import table
from baryscope.study.images.scene import Scene, write_images
from pictures import scene

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")


@pytest.fixture(scope="module")
def rendered():
    """The images of the scene that these tests look at, which are rendered once."""
    images, made = Scene.images, list(scene(24).images())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "images", lambda one: iter(made) if one is scene(24) else images(one))
        yield


@pytest.fixture(scope="module")
def tracked(rendered, tmp_path_factory):
    return track(*write_images(scene(24), tmp_path_factory.mktemp("images")), scene(24).pair, times=scene(24).time)


def test_the_centre_of_mass_of_what_the_images_show(tracked):
    """From files to the estimate: beyond its covariance the error is in one of 10⁴ draws. It was allowed to be as many
    times as large as a feature has sightings, 16, when errors of a feature that last were not found.
    """
    truth, seen = scene(24), tracked.tracks.seen
    assert seen.sum() > 300
    options = PathOptions(trajectory="fixed")
    result = estimate(tracked.tracks, method="pivot", camera=truth.camera, options=options)
    assert result.covariance is not None
    error, claimed = result.position[0] - truth.path[0], result.covariance[0]
    assert error @ np.linalg.solve(claimed, error) < chi2.ppf(1 - 1e-4, 3)
    assert np.sqrt(np.trace(claimed)) < 0.001  # of a distance of 5 m, and half a metre from the features
    assert result.status.trustworthy


def test_the_picture_has_the_features_on_the_body(tracked):
    """They lie on what is lit or in its own shade, not on the sky, of 1 grey value on average with the noise of 2; and
    their trails have as many points as sightings.
    """
    *_, (left, _) = scene(24).images()
    places = trails(scene(24), tracked)
    np.testing.assert_array_equal(np.isfinite(places[..., 0]), tracked.tracks.seen)
    columns, rows = np.rint(places[-1, tracked.tracks.seen[-1]]).astype(int).T
    around = uniform_filter(left.astype(np.float64), 5)
    assert (around[rows, columns] > 5).mean() > 0.9 > (around > 5).mean() + 0.3
    assert picture(scene(24), tracked).axes[0].images[0].get_array().shape == left.shape


def test_the_files_of_a_draw_are_those_that_the_commands_read(tmp_path, monkeypatch):
    """Of `baryscope track --rig` and `baryscope estimate --camera --rig --orbit`, for which there was no orbit."""
    monkeypatch.setattr(command, "drawn", lambda seed, setting: scene(3))
    assert command.main(["write", "-o", str(tmp_path / "draw")]) == 0
    camera = Camera.load(tmp_path / "draw" / "attitude.csv", tmp_path / "draw" / "rig.toml")
    known, read = scene(3).camera.errors(scene(3).time), camera.errors(scene(3).time)
    np.testing.assert_allclose(read.place, known.place, atol=1e-12)
    np.testing.assert_allclose(read.attitude, known.attitude, atol=1e-12)
    pair = load_pair(tmp_path / "draw" / "rig.toml")
    assert pair.left == scene(3).pair.left
    np.testing.assert_allclose(pair.R_left_right, scene(3).pair.R_left_right, atol=1e-15)
    assert len(list((tmp_path / "draw" / "right").glob("*.png"))) == 3
    assert load_orbit(tmp_path / "draw" / "orbit.toml") == scene(3).orbit.of_simulation()
    path = np.loadtxt(tmp_path / "draw" / "truth.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(path[:, 1:], scene(3).path)


def test_the_table_has_root_mean_squares_and_means():
    usual = {"method": "pivot", "noise": 2.0, "frames": 10, "features": 30, "observations": 200, "pixel_noise": 0.02}
    answers = [
        usual | {"rmse": rmse, "predicted_rmse": 2e-3, "nees": [1.0, 2.0, nees], "announced": False}
        for rmse, nees in ((3e-3, 3.0), (4e-3, 6.0))
    ]
    (row,) = table([*answers, answers[0] | {"announced": True, "rmse": 1.0}, usual | {"failure": "diverged"}]).rows
    assert row[:7] == ("2", "pivot", "4", "10", "30", "20", "0.020")
    assert row[7:11] == ("3.54", "3.5", "2", "2.5")  # √((9 + 16)/2), their middle, and (1 + 2 + 3 + 1 + 2 + 6)/6
    assert row[-2:] == ("1", "1")
