"""Attitudes turned over at random, in a steady rotation from scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.flips import steady


def rotation(count, step, noise, seed=0):
    turns = Rotation.from_rotvec(np.outer(step * np.arange(count), [0.6, 0, 0.8]))
    slow = Rotation.from_rotvec(np.outer(0.1 * step * np.arange(count), [0, 1.0, 0]))
    return slow * turns * Rotation.from_rotvec(noise * np.random.default_rng(seed).normal(size=(count, 3)))


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("step", [0.01, 0.5])
def test_flipped_attitudes_are_found_and_no_others(noise, step):
    true = rotation(300, step, noise)
    rng = np.random.default_rng(1)
    flipped = np.sort(rng.choice(np.arange(2, 298), 12, replace=False))
    attitude = true.as_matrix()
    attitude[flipped] = (true[flipped] * Rotation.from_rotvec(np.pi * np.eye(3)[rng.integers(0, 3, 12)])).as_matrix()
    kept = steady(np.arange(300), attitude)
    np.testing.assert_array_equal(np.nonzero(~kept)[0], flipped)
    assert steady(np.arange(300), true.as_matrix()).all()


@pytest.mark.parametrize("step", [0.0, 1.0, 2.5])
def test_rotations_that_cannot_be_followed_are_left_alone(step):
    assert steady(np.arange(200), rotation(200, step, 0.3).as_matrix()).all()
    assert steady(np.arange(100), Rotation.random(100, random_state=0).as_matrix()).all()
