"""The centre of mass from features in a line, such as two."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.document.files import write_estimate
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot import method
from baryscope.estimator.result import Status
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from free_paths import BOTH, FEATURES, NOISE, found_by, in_orbit, squared_error, turning
from synthetic import make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

TWO = FEATURES[[0, 3]]
LINE = TWO[0] + np.array([[0.0], [0.4], [1.0]]) * (TWO[1] - TWO[0])
DRAWS, FRAMES = 8, 150


def case(features, seed, noise=NOISE):
    time, R = turning(FRAMES)
    return make_case(time, R, in_orbit(time), features, noise=noise, seed=seed)


@BOTH
@pytest.mark.parametrize("features", [TWO, LINE], ids=["two", "three in a line"])
def test_errors_are_as_large_as_claimed(method, features):
    """Each square is χ²₃: the mean of eight lies in its band of 99.9 %."""
    squares = []
    for seed in range(DRAWS):
        made = case(features, seed)
        found = found_by(method, made.tracks, "relative-orbit", process_noise="none")
        assert found.status is Status.GOOD
        squares.append(squared_error(found, made))
    low, high = chi2.ppf([0.0005, 0.9995], 3 * DRAWS) / DRAWS
    assert low < np.mean(squares) < high


def with_three_frames_of_three(seed):
    """A case of two features, with a third one in three frames."""
    made = case(FEATURES[[0, 3, 5]], seed)
    position = made.tracks.position.copy()
    position[:70, 2] = position[73:, 2] = np.nan
    return replace(made, tracks=FeatureTracks(made.tracks.time, position, made.tracks.labels))


@BOTH
def test_a_few_frames_of_three_features_do_not_cost_those_of_two(method):
    """They have an attitude, but are too few for a path. Squares as above."""
    squares = []
    for seed in range(DRAWS):
        made = with_three_frames_of_three(seed)
        found = found_by(method, made.tracks, "relative-orbit", process_noise="none")
        assert found.status is Status.GOOD
        squares.append(squared_error(found, made))
    low, high = chi2.ppf([0.0005, 0.9995], 3 * DRAWS) / DRAWS
    assert low < np.mean(squares) < high


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_frames_that_show_two_of_them_are_covered(method, tmp_path):
    """By ekf none was, and the estimate could not be written."""
    made = case(TWO, 1)
    position = made.tracks.position.copy()
    position[40:45, 1] = np.nan
    found = estimate(FeatureTracks(made.tracks.time, position, made.tracks.labels), method=method)
    covered = np.ones(FRAMES, dtype=bool)
    covered[40:45] = False
    np.testing.assert_array_equal(found.covered, covered)
    write_estimate(found, tmp_path / "e.csv")


def test_without_noise_two_features_tell_the_centre_of_mass_exactly():
    made = case(TWO, 0, noise=0.0)
    found = found_by("pivot", made.tracks, "relative-orbit", process_noise="none")
    np.testing.assert_allclose(found.position, made.com, atol=1e-5)
    (cluster,) = found.clusters
    expected = np.linalg.norm(TWO, axis=1)  # from the centre of mass
    np.testing.assert_allclose(np.linalg.norm(cluster.points - cluster.centre_of_mass, axis=1), expected, atol=1e-5)


def test_without_an_orbit_a_smooth_path_is_told_as_well():
    made = case(LINE, 3)
    found = estimate(made.tracks)
    assert found.status is Status.GOOD
    assert squared_error(found, made) < chi2.ppf(0.9999, 3)
    assert found.predicted_rmse < 0.1


def exchanged(made, frames):
    """The tracks of two features, with each other's labels in some frames."""
    position = made.tracks.position.copy()
    position[frames] = position[frames][:, ::-1]
    return replace(made.tracks, position=position)


@BOTH
@pytest.mark.parametrize("seed", range(2))
def test_lines_that_are_turned_round_against_those_about_them_have_their_labels_exchanged(method, seed):
    """A fifth of the frames, which are as long as others: with them `pivot` was 0.2 m off, or claimed 53 mm."""
    made = case(TWO, seed)
    tracks = exchanged(made, np.random.default_rng([50, seed]).random(FRAMES) < 0.2)
    found = found_by(method, tracks, "relative-orbit", process_noise="none")
    assert found.status is Status.GOOD
    assert squared_error(found, made) < chi2.ppf(1 - 1e-3, 3)


def sparsely_seen(seed):
    """Two features of a body that turns by 2 rad from frame to frame, about an axis that sways by 0.05 rad."""
    time, turn = 60.0 * np.arange(24), np.outer(2.0 * np.arange(24), [0.0, 0.0, 1.0])
    R = Rotation.from_rotvec(0.3 * turn) * Rotation.from_rotvec([0.05, 0.0, 0.0]) * Rotation.from_rotvec(turn)
    return make_case(time, R.as_matrix(), in_orbit(time), TWO, noise=NOISE, seed=seed)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_lines_that_cannot_be_followed_are_refused_where_their_labels_may_be_exchanged(seed):
    """Two of 24 frames: all fit a centre of mass that is as far from both, 0.5 m off at a claim of 5 cm."""
    made = sparsely_seen(seed)
    plain = found_by("pivot", made.tracks, "relative-orbit", process_noise="none")
    assert squared_error(plain, made) < chi2.ppf(1 - 1e-3, 3)
    with pytest.raises(ComputationError, match="as it is where their labels are exchanged in some frames") as raised:
        found_by("pivot", exchanged(made, [5, 14]), "relative-orbit", process_noise="none")
    assert raised.value.reason is Reason.COLLINEAR_FEATURES


def about_one_axis(height):
    """Tracks of two features that turn about an axis, one higher than the other by some m."""
    time = np.arange(100.0)
    angle = 0.1 * time
    turned = np.zeros((100, 3, 3))
    turned[:, 0, 0] = turned[:, 1, 1] = np.cos(angle)
    turned[:, 1, 0], turned[:, 0, 1], turned[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    flat = np.array([[1.0, 0.2, 0.3], [-0.5, 0.8, 0.3 + height]])
    return make_case(time, turned, np.tile([4.0, -19.0, 3.0], (100, 1)), flat, noise=0.01, seed=0).tracks


@pytest.mark.parametrize(
    ("height", "words", "reason"),
    [
        (0.0, "at most 2 features are seen together", Reason.TOO_FEW_FEATURES),
        (0.5, "lie in a line, or no farther from one than their noise, and turn too little", Reason.COLLINEAR_FEATURES),
    ],
    ids=["in a plane", "on a cone"],
)
def test_lines_that_turn_about_one_axis_are_refused(height, words, reason):
    """Nothing but noise tells the place along the axis, which no offset of features in a line has to itself."""
    with pytest.raises(ComputationError, match=words) as raised:
        estimate(about_one_axis(height))
    assert raised.value.reason is reason


def hardly_off_one_axis(seed):
    """Tracks of two features whose axis of rotation is off its mean by 0.048 rad, and the path, a line."""
    time = np.arange(150.0)
    wobble = 0.048 * np.column_stack([np.sin(0.023 * time + 1), np.cos(0.031 * time), 0 * time])
    turned = Rotation.from_rotvec(wobble) * Rotation.from_rotvec(np.outer(0.1 * time, [0.0, 0.0, 1.0]))
    path = np.array([4.0, -19.0, 3.0]) + np.outer(time, [0.004, -0.003, 0.002])
    features = np.array([[1.0, 0.2, 0.3], [-0.5, 0.8, 0.8]])
    return make_case(time, turned.as_matrix(), path, features, noise=0.01, seed=seed)


def test_a_path_that_noise_seems_to_tell_in_part_is_claimed_without_that():
    """A seventh of the information along the axis is that of the noise of the attitudes. Squares along it are χ²₁,
    their mean lies in its band of 99.9 %: with that information it is beyond.
    """
    squares, draws, options = [], 80, PathOptions(trajectory="polynomial:1", process_noise="none")
    for seed in range(draws):
        made = hardly_off_one_axis(seed)
        try:
            found = estimate(made.tracks, options=options)
        except ComputationError:
            continue
        middle = len(made.com) // 2
        squares.append((found.position - made.com)[middle, 2] ** 2 / found.covariance[middle, 2, 2])
    assert len(squares) >= 0.95 * draws  # where noise makes the share of that information great, there is no answer
    low, high = chi2.ppf([0.0005, 0.9995], len(squares)) / len(squares)
    assert low < np.mean(squares) < high


def test_a_path_with_one_more_unknown_is_told_as_well():
    """Of drag, that is none: it is zero as claimed, within four deviations, and the path as true as without."""
    made = case(TWO, 0)
    found = found_by("pivot", made.tracks, "relative-orbit", process_noise="none", constant_acceleration="drag")
    assert found.status is Status.GOOD
    (drag,) = found.forces
    assert abs(drag.value) < 4 * drag.deviation
    assert squared_error(found, made) < chi2.ppf(0.999, 3)


def test_what_tells_no_path_is_refused_before_paths_of_more_degrees(monkeypatch):
    """These take minutes where frames are many."""
    paths = []

    def refined(start, options):
        paths.append(start.path)
        return kept(start, options)

    kept = method.refined
    monkeypatch.setattr(method, "refined", refined)
    monkeypatch.setattr(method, "_is_cut_short", lambda found: True)
    with pytest.raises(ComputationError, match="lie in a line"):
        estimate(about_one_axis(0.5))
    assert len(paths) == 1
