"""Screening of many features: in chunks, with the same result, and without memory that grows with their square."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration import screening
from baryscope.estimator.registration.screening import screen
from synthetic import box_features


def scattered(frames, features, seed=1):
    """Positions (n, m, 3) of a body at rest with noise, outliers among them, and which observations are right."""
    rng = np.random.default_rng(seed)
    position = box_features(features, (10, 5, 5), seed=3) + rng.normal(0, 0.01, (frames, features, 3))
    wrong = rng.random((frames, features)) < 0.1
    position[wrong] += rng.normal(0, 3, (wrong.sum(), 3))
    return position, ~wrong


@pytest.mark.parametrize("features", [6, 40])
def test_chunks_change_nothing(features, monkeypatch):
    position, right = scattered(50, features)
    whole = screen(position, np.ones_like(right))
    monkeypatch.setattr(screening, "CHUNK", 100)
    np.testing.assert_array_equal(screen(position, np.ones_like(right)), whole)
    assert np.mean(whole == right) > 0.98


def test_memory_of_many_features():
    """A matrix of pairs by features would take 35 MB, and the differences of all pairs at once 17 MB."""
    position, right = scattered(100, 600)
    tracemalloc.start()
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(screening, "CHUNK", 20_000)
            screen(position, np.ones_like(right))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 15e6


def seen_from_afar(ratio, wrong_share, seed, frames=400, features=8):
    """A tumbling body seen along z with noise that is `ratio` times as great in depth, covariances, what is right."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(np.linspace(0, 12, frames)[:, None] * [0.5, 0.6, 0.62]).as_matrix()
    position = [0.0, 0.0, 20.0] + box_features(features, (4, 3, 2), seed=3) @ np.swapaxes(turn, 1, 2)
    deviation = 0.01 * np.array([1.0, 1.0, ratio])
    position = position + deviation * rng.standard_normal(position.shape)
    wrong = rng.random(position.shape[:2]) < wrong_share
    position[wrong] += rng.normal(0, 3, (wrong.sum(), 3))
    return position, np.broadcast_to(np.diag(deviation**2), (frames, features, 3, 3)), ~wrong


@pytest.mark.parametrize("ratio", [1.0, 10.0, 40.0])
def test_right_observations_of_noise_in_depth_stay(ratio):
    """Six in ten thousand Gaussian values are beyond five deviations of a spread that is a third too small."""
    position, covariance, right = seen_from_afar(ratio, 0.0, 5)
    assert screen(position, right, covariance).mean() > 1 - 6e-4 * 7
    if ratio > 1:  # without covariances distances along the line of sight look like outliers
        assert screen(position, right).mean() < 0.97


@pytest.mark.parametrize("factor", [1.0, 1e-4, 100.0])
def test_outliers_across_the_line_of_sight_are_found_by_covariances_of_any_scale(factor):
    position, covariance, right = seen_from_afar(20.0, 0.1, 6)
    inliers = screen(position, np.ones_like(right), factor * covariance)
    assert inliers[right].mean() > 0.97
    assert inliers[~right].mean() < 0.1  # those that are off in depth by less than noise, in the main


def test_chunks_change_nothing_with_covariances(monkeypatch):
    position, covariance, right = seen_from_afar(20.0, 0.1, 7, frames=60)
    whole = screen(position, np.ones_like(right), covariance)
    monkeypatch.setattr(screening, "CHUNK", 200)
    np.testing.assert_array_equal(screen(position, np.ones_like(right), covariance), whole)
