"""What is said of an estimate, by covariances and weights made for the purpose."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.diagnostics import (
    Cluster,
    assessed,
    spurious_information_columns,
    three_sigma_factor,
    verdict,
)
from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.intervals import Interval
from baryscope.estimator.tracks import FeatureTracks

POINTS = np.array([[4.0, 0, 0], [2, 0, 0], [3, 1, 0], [3, -1, 0]])  # rms radius 1 m about (3, 0, 0)


def cluster(deviations, frames=10, axes=None):
    axes = np.eye(3) if axes is None else axes
    covariance = axes @ np.diag(np.square(deviations)) @ axes.T
    return Cluster(np.arange(4), np.arange(frames), (Interval(0, frames, (0, 1, 2, 3)),), POINTS, covariance)


def test_centre_and_size():
    one = cluster([1, 1, 1])
    np.testing.assert_allclose(one.centre_of_mass, [-3, 0, 0])
    assert one.radius == pytest.approx(1.0)


@pytest.mark.parametrize(
    "deviations, expected",
    [
        ([0.001, 0.002, 0.0123], "observable: ±0.012 m in the worst direction"),
        ([0.24, 0.24, 0.24], "observable: ±0.24 m in the worst direction"),
        ([0.001, 0.002, 0.26], "along-axis position not observable: ±0.26 m along (0.00, 0.00, 1.00) (cluster axes)"),
        ([0.001, 0.002, 4.0], "along-axis position not observable: ±4 m along (0.00, 0.00, 1.00) (cluster axes)"),
        ([0.001, 3.0, 4.0], "position across (1.00, 0.00, 0.00) not observable: ±4 m"),
        ([2.0, 3.0, 40.0], "position not observable: ±40 m"),
        ([0.0, 0.0, 0.0], "observable: ±0 m in the worst direction"),
    ],
)
def test_verdict(deviations, expected):
    """A quarter of the features' radius, 1 m, is the limit."""
    found = verdict(cluster(deviations))
    assert found.replace("-0.00", "0.00").replace("-1.00", "1.00") == expected


def test_verdict_names_a_skew_axis():
    axis = np.array([0.0, 0.6, 0.8])
    axes = np.column_stack([axis, [1, 0, 0], np.cross(axis, [1, 0, 0])])
    found = verdict(cluster([2.0, 0.01, 0.01], axes=axes))
    assert "along (0.00, 0.60, 0.80)" in found.replace("-", "")


def report(weights, covariance=None, **others):
    n, m = weights.shape
    tracks = FeatureTracks(np.arange(float(n)), np.zeros((n, m, 3)), tuple("abcd"), covariance)
    arguments = {"weights": weights, "variance": 4e-4, "options": PathOptions(), "begin": 0.0, "extra": {"more": 1}}
    clusters = others.pop("clusters", [cluster([0.01, 0.02, 0.03], frames=n)])
    position = np.arange(3.0 * n).reshape(n, 3)
    each = np.tile(np.diag([1.0, 4.0, 9.0]) * 1e-4, (n, 1, 1))
    return assessed("pivot", tracks, "fixed", position, each, clusters, **arguments | others)


def test_what_was_rejected_when():
    weights = np.ones((10, 4))
    weights[2:5, 0] = weights[7, 0] = 0.4
    weights[:6, 1] = 1e-9
    weights[:, 2] = 0.6
    weights[5:, 3] = 0.0  # not seen, or not used
    said = report(weights).diagnostics
    assert said["rejected_observations"] == {"a": [[2.0, 4.0], [7.0, 7.0]], "b": [[0.0, 5.0]]}
    assert said["rejected_features"] == ["b"]
    assert said["rejected_share"] == pytest.approx(10 / 35)


def test_nothing_rejected():
    said = report(np.ones((10, 4))).diagnostics
    assert (said["rejected_observations"], said["rejected_features"], said["rejected_share"]) == ({}, [], 0.0)


def test_numbers():
    found = report(np.ones((10, 4)), remarks=("look here",))
    said = found.diagnostics
    assert said["residual_rms"] == pytest.approx(0.02)
    assert said["variance_factor"] is None
    assert said["condition_number"] == pytest.approx(9)
    assert said["least_observable_direction"]["deviation"] == pytest.approx(0.03)
    np.testing.assert_allclose(np.abs(said["least_observable_direction"]["direction"]), [0, 0, 1], atol=1e-12)
    assert said["position_deviation"] == pytest.approx(np.sqrt(14e-4))
    assert said["options"]["trajectory"] == "fixed"
    assert said["remarks"] == ["look here"]
    assert said["more"] == 1
    (one,) = said["clusters"]
    assert (one["start"], one["end"], one["frames"], one["intervals"]) == (0.0, 9.0, 10, [[0.0, 9.0]])
    assert one["centre_of_mass"] == [-3.0, 0.0, 0.0]
    np.testing.assert_allclose(list(one["features"].values()), POINTS - [3.0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(one["centre_of_mass_covariance"], np.diag([1e-4, 4e-4, 9e-4]), atol=1e-18)


def test_with_covariances_the_variance_is_a_factor():
    covariance = np.tile(np.eye(3), (10, 4, 1, 1))
    said = report(np.ones((10, 4)), covariance, variance=1.5).diagnostics
    assert (said["residual_rms"], said["variance_factor"]) == (None, 1.5)


def test_the_cluster_of_most_frames_speaks_for_all_and_gaps_are_not_covered():
    few, many = cluster([1.0, 1.0, 1.0], frames=3), cluster([0.01, 0.02, 0.03], frames=6)
    said = report(np.ones((10, 4)), clusters=[few, many]).diagnostics
    assert said["verdict"] == "observable: ±0.03 m in the worst direction"
    assert said["least_observable_direction"]["axes"] == "cluster 1"
    assert said["covered_share"] == pytest.approx(0.6)


def test_spurious_information_is_taken_away():
    """Against the joint covariance of offset and other unknowns, inverted, less the spurious part, inverted again."""
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(7, 7))
    joint = factor @ factor.T
    offset, crossed, others = joint[:3, :3], joint[:3, 3:], joint[3:, 3:]
    values, axes = np.linalg.eigh(np.linalg.inv(offset))
    spurious = (axes * (values * [0.9, 0.5, 0.0])) @ axes.T
    information = np.linalg.inv(joint)
    information[:3, :3] -= spurious
    expected = np.linalg.inv(information)
    columns, gain = spurious_information_columns(offset, crossed, spurious, 1e-9)
    np.testing.assert_allclose(offset + columns @ columns.T, expected[:3, :3], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(others + gain @ gain.T, expected[3:, 3:], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(crossed + columns @ gain.T, expected[:3, 3:], rtol=1e-9, atol=1e-9)


def test_of_information_that_only_seems_the_least_remains():
    columns, _ = spurious_information_columns(np.eye(3), np.zeros((3, 2)), np.diag([0.0, 0.0, 1.2]), least=1 / 400)
    np.testing.assert_allclose(np.eye(3) + columns @ columns.T, np.diag([1.0, 1.0, 400.0]), rtol=1e-12)
    assert three_sigma_factor(200) == pytest.approx(1.3)
