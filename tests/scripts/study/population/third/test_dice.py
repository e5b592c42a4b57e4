"""Random streams and shapes."""

import numpy as np
import pytest

from baryscope.study.population.third.dice import direction, log_uniform, rotation, stream


def test_streams_are_their_own_and_the_same_again():
    values = [stream(s, i, p, d).random() for s in (1, 2) for i in (0, 1) for p in ("plan", "view") for d in (0, 1)]
    assert len(set(values)) == len(values)
    assert stream(1, 0, "plan").random() == values[0]


def test_log_uniform_numbers_have_a_uniform_logarithm():
    rng = np.random.default_rng(1)
    logs = np.log10([log_uniform(rng, 1e-3, 10) for _ in range(4000)])
    assert logs.min() >= -3
    assert logs.max() <= 1
    assert logs.mean() == pytest.approx(-1, abs=4 * 4 / np.sqrt(12 * 4000))


def test_directions_and_rotations():
    rng = np.random.default_rng(2)
    R = rotation(rng)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1)
    mean = np.mean([direction(rng) for _ in range(3000)], axis=0)
    assert np.abs(mean).max() < 4 / np.sqrt(3 * 3000)
    assert np.linalg.norm(direction(rng)) == pytest.approx(1)
