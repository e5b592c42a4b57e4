"""Features that move on the body: on a wing that swings, or along an edge."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.findings import MovingFeatures
from baryscope.estimator.noise.rigid_features import CHANCE, WindowMeans, _Equations
from baryscope.estimator.result import Status

TIME = np.arange(300.0)
CENTRE = np.array([3.0, -5.0, 20.0])
NOISE = 0.004
DEPTH = 4.0
FIXED = PathOptions(trajectory="fixed")


def tracked(seed, motion=0.0, memory=0.0, depth=1.0, told=False, last=(0.7, 1.0)):
    """Eight features about a fixed centre; the last two move on the body by `motion` (n,), m, times `last` along its z
    axis.

    memory: the autocorrelation of all features' errors from one frame to the next; depth: how much noisier depths are,
    as covariances tell if told.
    """
    rng = np.random.default_rng(seed)
    precession = Rotation.from_rotvec(0.004 * TIME[:, None] * np.array([0.3, 0.9, 0.1]))
    R = (precession * Rotation.from_rotvec(0.02 * TIME[:, None] * np.array([0.0, 0.6, 0.8]))).as_matrix()
    points = np.concatenate([rng.normal(size=(6, 3)), [[4.0, 0.3, 0.0], [5.0, -0.3, 0.0]]])
    moved = points + np.reshape(motion, (-1, 1, 1)) * np.array([0, 0, 0, 0, 0, 0, *last])[:, None] * [0, 0, 1]
    position = CENTRE + moved @ np.swapaxes(R, 1, 2)
    sight = position / np.linalg.norm(position, axis=2, keepdims=True)
    axes = np.eye(3) + (depth - 1) * sight[..., :, None] * sight[..., None, :]
    white = rng.normal(size=(100 + len(TIME), 8, 3)) * np.sqrt(1 - memory**2)
    noise = NOISE * lfilter([1], [1, -memory], white, axis=0)[100:]
    covariance = NOISE**2 * axes @ axes if told else None
    return FeatureTracks(TIME, position + (axes @ noise[..., None])[..., 0], tuple("abcdefgh"), covariance)


def swing(seed):
    return 0.02 * np.sin(2 * np.pi * (TIME / 120 + np.random.default_rng([seed, 1]).uniform()))


def moving(found):
    return [one.labels for one in found.findings if isinstance(one, MovingFeatures)]


@pytest.mark.parametrize(("method", "seed"), [("pivot", 0), ("pivot", 1), ("ml", 2), ("ekf", 0)])
def test_features_of_a_wing_that_swings_are_left_out(method, seed):
    """As good as tracks without the wing: these are all that is left."""
    tracks = tracked(seed, swing(seed))
    found = estimate(tracks, method=method, options=FIXED)
    assert moving(found) == [("g", "h")]
    without = np.where(np.isin(tracks.labels, ["g", "h"])[:, None], np.nan, tracks.position)
    alone = estimate(replace(tracks, position=without), method=method, options=FIXED)
    assert found.position == pytest.approx(alone.position, abs=1e-9)
    assert found.noise.a_posteriori == pytest.approx(NOISE, rel=0.1)
    error = found.position[150] - CENTRE
    assert error @ np.linalg.solve(found.covariance[150], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("seed", range(3))
def test_a_feature_that_comes_back_on_another_place_is_left_out(seed):
    """As a glint, at rest while the same others are seen; its distance from the centre is the same to a millimetre."""
    later = TIME >= 200
    tracks = tracked(seed, 20 * NOISE * later, last=(0.0, 1.0))
    hidden = np.where(later[:, None], np.equal(tracks.labels, "b"), np.equal(tracks.labels, "c"))
    hidden |= ((TIME > 150) & ~later)[:, None]
    found = estimate(replace(tracks, position=np.where(hidden[..., None], np.nan, tracks.position)), options=FIXED)
    assert moving(found) == [("h",)]
    assert found.status is Status.GOOD
    error = found.position[150] - CENTRE
    assert error @ np.linalg.solve(found.covariance[150], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize(("told", "seed"), [(False, 1), (True, 2)])
def test_a_wing_is_found_where_depths_are_noisier(seed, told):
    found = estimate(tracked(seed, 2 * swing(seed), depth=DEPTH, told=told), options=FIXED)
    assert moving(found) == [("g", "h")]
    assert found.noise.relative == told


@pytest.mark.parametrize("seed", range(3))
def test_a_wing_is_found_by_what_it_swings_across_the_lines_of_sight(seed):
    """By six deviations across them, of which those along them are eight times as great."""
    found = estimate(tracked(seed, 1.2 * swing(seed), depth=8.0, told=True), options=FIXED)
    assert moving(found) == [("g", "h")]
    error = found.position[150] - CENTRE
    assert error @ np.linalg.solve(found.covariance[150], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("seed", range(3))
def test_a_feature_that_slides_steadily_is_left_out(seed):
    """Along an edge, by ten standard deviations of an observation from end to end, and another by seven."""
    (labels,) = moving(estimate(tracked(seed, 10 * NOISE * TIME / TIME[-1]), options=FIXED))
    assert labels == ("g", "h")


@pytest.mark.parametrize(("memory", "depth"), [(0.0, DEPTH), (0.9, 1.0)])
def test_errors_that_last_alike_are_no_motion(memory, depth):
    """In more than two of 12 draws something is found to move with a probability of 2e-4, if in one with CHANCE."""
    found = [moving(estimate(tracked(seed, memory=memory, depth=depth), options=FIXED)) for seed in range(12)]
    assert CHANCE <= 0.01
    assert sum(map(bool, found)) <= 2


def test_the_squares_left_are_those_of_a_dense_adjustment():
    """Of places on the body and its rotations and shifts in four windows, with features that are not seen in some."""
    rng = np.random.default_rng(5)
    windows, many = 4, 6
    arms, mean = rng.normal(size=(many, 3)), rng.normal(size=(windows, many, 3))
    roots = rng.normal(size=(windows, many, 3, 3))
    roots[0, 1] = roots[2, 4] = roots[3, 4] = 0.0
    information = np.swapaxes(roots, 2, 3) @ roots
    weighted = np.einsum("kmij,kmj->kmi", information, mean)
    means = WindowMeans(np.arange(many), arms, information, weighted, *np.ones((2, many)))
    kept = np.array([True, True, False, True, True, True])
    rows, right = [], []
    for k in range(windows):
        for i in np.flatnonzero(kept):
            row = np.zeros((3, 6 * windows + 3 * many))
            row[:, 6 * k : 6 * k + 3] = -np.cross(arms[i], np.eye(3))
            row[:, 6 * k + 3 : 6 * k + 6] = np.eye(3)
            row[:, 6 * windows + 3 * i : 6 * windows + 3 * i + 3] = np.eye(3)
            rows.append(roots[k, i] @ row)
            right.append(roots[k, i] @ mean[k, i])
    dense, side = np.concatenate(rows), np.concatenate(right)
    solution = np.linalg.lstsq(dense, side, rcond=None)[0]
    left = np.sum((dense @ solution - side) ** 2)
    assert _Equations.of(means).left(kept) == pytest.approx(left, rel=1e-6)
    seen = 3 * int(information[:, kept].any(axis=(2, 3)).sum())
    assert means._freedom(kept) == seen - np.linalg.matrix_rank(dense)
