"""Features of which everything is rejected: they leave their bodies, and the others tell as much as without them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.pivot.lost_bodies import without_scraps, without_untold_features
from baryscope.estimator.registration.body import Body
from synthetic import ENVISAT, attitude, box_features, make_case

TIME = np.arange(0.0, 200.0, 1.0)
FEATURES = box_features(7, (4, 3, 2), seed=2, centre=(0.5, 0.3, -0.2))
NOISE = 0.01  # m


@pytest.fixture(scope="module")
def astray():
    """Tracks of which one label is beside the body for a while, and does not turn with it; and the path."""
    com = np.array([2.0, 18.0, -5.0]) + np.outer(TIME, [0.004, -0.003, 0.002])
    tracks = make_case(TIME, attitude(ENVISAT, np.array([0.02, 0.05, 0.01]), TIME), com, FEATURES, noise=NOISE).tracks
    position = tracks.position.copy()
    position[:60, 6] += np.array([1.0, 1.0, 0.0])
    position[60:, 6] = np.nan
    return FeatureTracks(TIME, position, tracks.labels), com


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_a_label_without_a_right_observation_costs_nothing(astray, method):
    """But for a few right observations that may be rejected with it: of a hundredth less, estimates differ by a tenth
    of a deviation (Hausman 1978: the covariance of the difference is the difference of the covariances); three of
    these, and three hundredths of a covariance.
    """
    tracks, com = astray
    options = PathOptions(trajectory="polynomial:1", process_noise="none", sigma=NOISE)
    without = FeatureTracks(TIME, tracks.position[:, :6], tracks.labels[:6])
    found, best = (estimate(one, method=method, options=options) for one in (tracks, without))
    assert str(found.status) == str(best.status) == "good"
    assert found.rejected[:60, 6].all()
    assert found.rejected[:, :6].mean() < 0.01
    deviation = np.sqrt(np.diagonal(best.covariance, axis1=1, axis2=2))
    assert (np.abs(found.position - best.position) / deviation).max() < 0.3
    off = np.abs(found.covariance - best.covariance) / (deviation[:, :, None] * deviation[:, None])
    assert off.max() < 0.03
    (cluster,) = found.clusters
    assert "F6" not in cluster.labels
    nees = np.einsum("ni,nij,nj->n", found.position - com, np.linalg.inv(found.covariance), found.position - com)
    assert nees.max() < 16.3  # of a true covariance with p = 0.001


def body(points):
    count = len(points)
    return Body(np.arange(count), np.arange(2), np.asarray(points, float), np.tile(np.eye(3), (2, 1, 1)))


def test_only_features_that_are_all_rejected_leave():
    rng = np.random.default_rng(1)
    own = body(rng.uniform(-1, 1, (5, 3)))
    weight = np.ones((2, 5))
    assert without_untold_features((own,), weight) is None
    weight[:, 1], weight[0, 3] = 1e-9, 1e-9
    (fewer,), left = without_untold_features((own,), weight)
    np.testing.assert_array_equal(fewer.features, [0, 2, 3, 4])
    np.testing.assert_array_equal(fewer.points, own.points[[0, 2, 3, 4]])
    np.testing.assert_array_equal(left, np.where(np.arange(5) == 1, 0.0, weight))


def test_a_body_that_would_be_left_with_a_line_or_two_features_keeps_all():
    flat = body([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]])
    for gone in ([3], [0, 1]):
        weight = np.ones((2, 4))
        weight[:, gone] = 1e-9
        assert without_untold_features((flat,), weight) is None


def test_nothing_is_left_of_a_body_of_which_hardly_anything_is_right():
    """By chance one of fourteen observations agrees with the path; of another body two of five do."""
    weight = np.full((4, 5), 1e-6)
    weight[0, 1], weight[1, 1:3], weight[1, 4], weight[3] = 1.0, 0.4, 0.0, [1.0, 1.0, 1e-9, 1e-9, 0.3]
    lost, right = (replace(body(np.ones((5, 3))), frames=frames) for frames in (np.arange(3), np.array([3])))
    left = without_scraps((lost, right), weight)
    np.testing.assert_array_equal(left[3], weight[3])
    np.testing.assert_array_equal(left[:3], np.where(weight[:3] > 0, 1e-9, 0.0))


def probe(seed, between, share):
    """A probe that turns about a fixed tip, seen with labels of its own for some frames between two long parts, where
    this share of its four markers' positions is wrong by up to 10 cm; and the same without those frames.
    """
    rng, noise, whole = np.random.default_rng(seed), 2e-4, 150
    time = np.arange(2 * whole + between) / 25.0
    turns = np.stack([0.5 * np.sin(0.9 * time), 0.4 * np.cos(0.7 * time), 0.3 * np.sin(1.3 * time)], axis=1)
    markers = np.array([0, 0, 0.1]) + rng.uniform(-0.06, 0.06, (8, 3))
    places = TIP + np.einsum("nij,mj->nmi", Rotation.from_rotvec(turns).as_matrix(), markers)
    places += noise * rng.standard_normal(places.shape)
    position = np.full((len(time), 18, 3), np.nan)
    position[:whole, :7], position[whole + between :, 11:] = places[:whole, :7], places[whole + between :, :7]
    without = position.copy()
    middle = slice(whole, whole + between)
    wrong = rng.random((between, 4)) < share
    position[middle, 7:11] = places[middle, :4] + wrong[..., None] * rng.uniform(-0.1, 0.1, (between, 4, 3))
    labels = [f"F{index}" for index in range(18)]
    return FeatureTracks(time, position, labels), FeatureTracks(time, without, labels)


TIP = np.array([1.0, 2.0, 0.5])


@pytest.mark.parametrize(("seed", "between", "share"), [(5, 10, 0.1), (9, 10, 0.15), (6, 13, 0.15)])
def test_a_short_body_that_outliers_have_spoilt_costs_nothing(seed, between, share):
    """All of it was rejected at once, and the answer was centimetres wide: `model does not fit`. It adds information,
    so that the claim is at most that without it, but for what a standard deviation of 600 frames is told to, 1 %.
    """
    tracks, without = probe(seed, between, share)
    found, known = (estimate(one, options=PathOptions(trajectory="fixed")) for one in (tracks, without))
    assert str(found.status) == str(known.status) == "good"
    assert len(found.clusters) == 3
    assert found.predicted_rmse < 1.03 * known.predicted_rmse
    error = found.position[0] - TIP
    assert error @ np.linalg.solve(found.covariance[0], error) < 16.3  # of a true covariance with p = 0.001
