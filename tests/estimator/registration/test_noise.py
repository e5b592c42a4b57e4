"""The noise that registration and distances tell, and of how many values: their scatter over draws."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.noise import noise_of_distances, pooled_noise
from baryscope.estimator.registration.procrustes import register
from synthetic import box_features

NOISE = 0.02  # m
DRAWS = 400


def drawn(frames, features, share, draw):
    """Points (n, m, 3) with noise, and which are seen."""
    rng = np.random.default_rng([frames, features, draw])
    R = Rotation.random(frames, rng=rng).as_matrix()
    body = box_features(features, (4, 3, 2), seed=3)
    position = body @ np.swapaxes(R, 1, 2) + NOISE * rng.standard_normal((frames, features, 3))
    return position, rng.random((frames, features)) < share


@pytest.mark.parametrize(
    ("frames", "features", "share"),
    [(10, 4, 1.0), (30, 4, 1.0), (30, 8, 1.0), (100, 4, 0.8), (20, 3, 1.0), (15, 7, 0.5)],
)
def test_distances_tell_the_noise_and_how_well(frames, features, share):
    """Of k values a variance is known to √(2/k): the claimed k is true within a factor of 1.5, over 400 draws."""
    found = [noise_of_distances(*drawn(frames, features, share, draw)) for draw in range(DRAWS)]
    variance = np.array([one.deviation**2 for one in found]) / NOISE**2
    values = np.mean([one.values for one in found])
    assert variance.mean() == pytest.approx(1, abs=0.08 + 4 * np.sqrt(2 / values / DRAWS))
    assert values == pytest.approx(2 / (variance.std() / variance.mean()) ** 2, rel=0.5)


def test_many_features_of_which_two_are_seen_at_a_time_take_little_memory():
    """All pairs in all frames were 300 MB here, and 10 GB of 3000 frames and 1500 features."""
    frames, features = 600, 1000
    used = np.zeros((frames, features), dtype=bool)
    rows = np.arange(frames)
    used[rows, rows // 2], used[rows, rows // 2 + 1] = True, True
    position = np.broadcast_to(np.arange(features)[:, None] * [0.3, 0.4, 0.0], (frames, features, 3))
    tracemalloc.start()
    try:
        found = noise_of_distances(position, used)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found.deviation < 1e-12
    assert peak < 8 * (2 * frames * features + 4 * features**2)  # floats for the frames, and for the pairs


def test_registrations_tell_the_noise_of_as_many_values_as_are_left():
    found = []
    for draw in range(100):
        position, _ = drawn(20, 5, 1.0, draw)
        found.append(pooled_noise([register(position)], [position]))
    variance = np.array([one.deviation**2 for one in found]) / NOISE**2
    values = 3 * 20 * 5 - 6 * 20 - 3 * 5 + 6  # of 20 frames and 5 features
    assert np.mean([one.values for one in found]) == pytest.approx(values, rel=0.02)
    assert variance.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / values / 100))
    assert 2 / variance.std() ** 2 == pytest.approx(values, rel=4 * np.sqrt(2 / 100))
