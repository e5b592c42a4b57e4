"""Noise of a stereo rig at the estimated point, against the rig's covariance there and the mean score of many draws."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator import estimate
from baryscope.estimator.adjustment.stereo import StereoNoise, observations_of, stereo_noise, varies_with_range
from baryscope.estimator.options import PathOptions
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.scenario import StereoRig
from baryscope.models.sensor.directions import axes_along
from baryscope.models.stereo import project, triangulate
from synthetic import ENVISAT, attitude, box_features, rig_tracks

RIG = StereoRig(focal_length=1911.0, baseline=1.0, pixel_noise=0.5)
TARGET = 20.0 * np.array([0.48, -0.6, 0.64])
R_C_V = axes_along(TARGET[None])
COUNT = 8


def random_points(rng, spread=3.0):
    """Points (1, m, 3) in C around the target, 20 m away."""
    return TARGET + spread * rng.uniform(-1, 1, (1, COUNT, 3))


def rig_covariance(points):
    """The rig's covariance at points (1, m, 3)."""
    return triangulate(RIG, R_C_V, project(RIG, R_C_V, points))[1]


def observations(position, covariance):
    labels = tuple(f"F{k}" for k in range(position.shape[1]))
    tracks = FeatureTracks(np.arange(float(len(position))), position, labels, covariance)
    return observations_of(tracks, tracks.seen)


def relative_error(found, expected):
    """Largest eigenvalue of found against expected, less one."""
    root = np.linalg.inv(np.linalg.cholesky(expected))
    return np.abs(np.linalg.eigvalsh(root @ found @ np.swapaxes(root, -1, -2)) - 1).max()


@pytest.mark.parametrize("direction", ["along", "across"])
def test_the_covariance_agrees_with_the_rigs_at_the_estimated_point(direction):
    """Measured with an error of 0.15 m (1σ) in depth or 5 cm (10σ) across: more than 90 % of the change is corrected.

    The rest comes from the axes of the pixels, which are not exactly perpendicular to the line of sight: features lie
    up to 3 m off the boresight at 20 m, 0.15 rad.
    """
    rng = np.random.default_rng(0)
    truth = random_points(rng)
    sight = truth / np.linalg.norm(truth, axis=2, keepdims=True)
    aside = np.cross(sight, rng.normal(size=truth.shape))
    aside /= np.linalg.norm(aside, axis=2, keepdims=True)
    for sign in (-1, 1):
        measured = truth + sign * (0.15 * sight if direction == "along" else 0.05 * aside)
        given = observations(measured, rig_covariance(measured))
        moved = StereoNoise.of(given, 1.0).moved_to(truth, given.weight)
        before = relative_error(rig_covariance(measured), rig_covariance(truth))
        after = relative_error(np.linalg.inv(moved.precision), rig_covariance(truth))
        assert before > 0.02
        assert after < before / 10
        assert after < 0.005


def test_the_score_has_no_bias():
    """50,000 observations of each of 8 points: the mean of P (measured − truth), with P transferred to the truth.

    In units of its standard deviation, √P, an unbiased mean score is below 5/√(400,000). With P at the measured point
    its bias is −2 σ_r/r = −0.015: the P of a point measured too near is too large.
    """
    draws = 50_000
    rng = np.random.default_rng(1)
    truth = np.broadcast_to(random_points(rng), (draws, COUNT, 3))
    axes = np.broadcast_to(R_C_V, (draws, 3, 3))
    pixels = project(RIG, axes, truth) + RIG.pixel_noise * rng.standard_normal(truth.shape)
    given = observations(*triangulate(RIG, axes, pixels))
    sight = truth[0] / np.linalg.norm(truth[0], axis=1, keepdims=True)
    information = np.einsum("mi,mij,mj->m", sight, np.linalg.inv(rig_covariance(truth[:1])[0]), sight)

    def bias(observed):
        score = np.einsum("mi,kmij,kmj->km", sight, observed.precision, observed.position - truth)
        return float((score / np.sqrt(information)).mean())

    assert bias(given) < -0.01
    assert abs(bias(StereoNoise.of(given, 1.0).moved_to(truth, given.weight))) < 5 / np.sqrt(draws * COUNT) + 1e-3


def test_the_score_across_the_line_of_sight_has_no_bias():
    draws = 50_000
    rng = np.random.default_rng(2)
    truth = np.broadcast_to(random_points(rng), (draws, COUNT, 3))
    axes = np.broadcast_to(R_C_V, (draws, 3, 3))
    pixels = project(RIG, axes, truth) + RIG.pixel_noise * rng.standard_normal(truth.shape)
    given = observations(*triangulate(RIG, axes, pixels))
    moved = StereoNoise.of(given, 1.0).moved_to(truth, given.weight)
    score = np.einsum("kmij,kmj->mi", moved.precision, moved.position - truth) / draws
    information = np.linalg.inv(rig_covariance(truth[:1])[0])
    # The mean score of each point in standard deviations: √(sᵀ I⁻¹ s).
    step = np.sqrt(np.einsum("mi,mij,mj->m", score, np.linalg.inv(information), score))
    # χ with three degrees of freedom, over √draws, exceeds 5.2 with a probability of 6e-6; 2e-3 for the second order.
    assert step.max() < 5.2 / np.sqrt(draws) + 2e-3


@pytest.mark.parametrize("shown", [1.0, 0.2])
def test_only_the_range_bias_is_removed_at_the_measured_point(shown):
    rng = np.random.default_rng(3)
    measured = random_points(rng)
    given = observations(measured, rig_covariance(measured))
    moved = StereoNoise.of(given, shown).moved_to(measured, 0.5 * given.weight)
    np.testing.assert_allclose(moved.precision, given.precision, rtol=1e-9, atol=1e-9 * given.precision.max())
    np.testing.assert_array_equal(moved.weight, 0.5 * given.weight)
    sight = measured / np.linalg.norm(measured, axis=2, keepdims=True)
    variance = np.einsum("kmi,kmij,kmj->km", sight, rig_covariance(measured), sight)
    expected = 1 - shown * variance / (measured**2).sum(axis=2)
    np.testing.assert_allclose(moved.position, measured * expected[..., None], rtol=1e-12)


@pytest.mark.parametrize(("method", "factor"), [("pivot", 6.0), ("pivot", 0.2), ("ml", 6.0), ("ekf", 6.0)])
def test_a_rigs_covariances_may_be_wrong_by_a_factor(method, factor):
    """The range's bias, of 1.2 deviations of the centre of mass, is that of the noise, not of what is told of it."""
    time = np.arange(0.0, 300.0, 2.0)
    R, com = attitude(ENVISAT, np.deg2rad([2.4, 4.4, 4.8]), time), np.tile([4.0, -19.0, 3.0], (150, 1))
    right = rig_tracks(time, R, com, box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0)), seed=0)
    told = replace(right, covariance=factor * right.covariance)
    options = PathOptions(trajectory="fixed")
    expected, found = (estimate(tracks, method=method, options=options) for tracks in (right, told))
    assert found.noise.a_posteriori == pytest.approx(expected.noise.a_posteriori / np.sqrt(factor), rel=0.01)
    apart = found.position[0] - expected.position[0]
    # With the bias of what is told these were 1.2 (factor − 1) deviations.
    assert apart @ np.linalg.solve(expected.covariance[0], apart) < 0.2**2


def test_missing_and_isotropic_observations_are_unchanged():
    rng = np.random.default_rng(4)
    position = np.repeat(random_points(rng), 3, axis=0)
    position[1, 2] = np.nan
    covariance = np.where(np.isnan(position)[..., None], np.nan, 0.01 * np.eye(3))
    given = observations(position, covariance)
    assert given.weight[1, 2] == 0
    np.testing.assert_array_equal(given.position[1, 2], 0)
    moved = StereoNoise.of(given, 1.0).moved_to(np.nan_to_num(position) + 0.1, given.weight)
    assert np.isfinite(moved.precision).all()
    assert np.isfinite(moved.position).all()
    plain = observations(position, None)
    assert plain.precision is None
    assert stereo_noise(plain, plain.position, "stereo", 1.0) is None


def test_a_singular_covariance_is_refused():
    position = random_points(np.random.default_rng(5))
    with pytest.raises(InputError, match=r"covariance of feature 'F0' at 0\.0 s has standard deviations of 0 to 1 m"):
        observations(position, np.broadcast_to(np.diag([1.0, 1.0, 0.0]), (1, COUNT, 3, 3)))


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf", "score"])
def test_covariances_of_zero_are_refused_before_anything_is_computed_from_them(method):
    position = np.repeat(random_points(np.random.default_rng(5)), 20, axis=0)
    tracks = FeatureTracks(np.arange(20.0), position, tuple("abcdefgh"), np.zeros((20, COUNT, 3, 3)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(
            InputError, match=r"^covariance of feature 'a' at 0\.0 s has standard deviations of 0 to 0 m"
        ):
            estimate(tracks, method=method)


def a_walk(frames=50):
    """Points (n, m, 3) around the target, at other places in each frame."""
    rng = np.random.default_rng(4)
    return TARGET + 3.0 * rng.uniform(-1, 1, (frames, COUNT, 3)), np.broadcast_to(R_C_V, (frames, 3, 3)), rng


def test_a_rigs_covariances_tell_that_they_are_those_of_the_measured_points():
    truth, axes, rng = a_walk()
    pixels = project(RIG, axes, truth) + RIG.pixel_noise * rng.standard_normal(truth.shape)
    given = observations(*triangulate(RIG, axes, pixels))
    assert varies_with_range(given, truth, "auto")
    assert not varies_with_range(given, truth, "fixed")


def test_a_rigs_covariances_at_the_true_points_tell_that_they_are():
    """As those of a simulation, or of a tracker that smooths: they go with the range, but not with its error."""
    truth, axes, rng = a_walk()
    measured, _ = triangulate(RIG, axes, project(RIG, axes, truth) + RIG.pixel_noise * rng.standard_normal(truth.shape))
    _, covariance = triangulate(RIG, axes, project(RIG, axes, truth))
    given = observations(measured, covariance)
    assert not varies_with_range(given, truth, "auto")
    assert varies_with_range(given, truth, "stereo")
    assert stereo_noise(given, truth, "auto", 1.0) is None


@pytest.mark.parametrize("at_measured", [True, False])
def test_outliers_frames_out_of_place_and_points_that_are_not_estimated_do_not_hide_it(at_measured):
    truth, axes, rng = a_walk(200)
    pixels = project(RIG, axes, truth) + RIG.pixel_noise * rng.standard_normal(truth.shape)
    wrong = rng.random(truth.shape[:2]) < 0.1
    measured, covariance = triangulate(RIG, axes, pixels)
    if not at_measured:
        _, covariance = triangulate(RIG, axes, project(RIG, axes, truth))
    other = rng.permutation(COUNT)
    measured[wrong], covariance[wrong] = measured[:, other][wrong], covariance[:, other][wrong]
    estimated = truth + 0.3 * rng.standard_normal((200, 1, 3))
    estimated[:, 0] = measured[:, 0]
    assert varies_with_range(observations(measured, covariance), estimated, "auto") == at_measured


def test_covariances_of_each_feature_tell_that_they_are_fixed():
    truth, axes, rng = a_walk()
    deviation = np.array([0.01, 0.01, 0.2]) * np.linspace(1, 3, COUNT)[:, None]
    covariance = axes[:, None] @ (deviation[..., None] ** 2 * np.eye(3)) @ np.swapaxes(axes, 1, 2)[:, None]
    noise = (axes[:, None] @ (deviation * rng.standard_normal(truth.shape))[..., None])[..., 0]
    given = observations(truth + noise, covariance)
    assert not varies_with_range(given, truth, "auto")
    assert varies_with_range(given, truth, "stereo")


def test_tracks_without_covariances_have_none_that_vary():
    truth, _, _ = a_walk()
    given = observations_of(FeatureTracks(np.arange(50.0), truth, tuple("abcdefgh")), np.ones((50, COUNT), dtype=bool))
    assert not varies_with_range(given, truth, "auto")
    assert not varies_with_range(given, truth, "stereo")
