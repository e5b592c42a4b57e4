"""Screening of many features: in chunks, with the same result, and without memory that grows with their square."""

import tracemalloc

import numpy as np
import pytest

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
