"""Covariances of attitudes that observations determine, or not."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.normal_equations import attitude_covariances, turn_information
from baryscope.estimator.geometry.so3 import cross_matrices


@pytest.mark.parametrize("sigma", [1e-2, 1e-5, 1e-8])
def test_a_turn_about_two_points_is_not_known(sigma):
    """Across the line of the points it is σ²/Σb²; about the line any angle is as good, of a variance of a radian²."""
    points = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    information = turn_information(np.ones((1, 2)), cross_matrices(points))
    assert attitude_covariances(information, sigma**2)[0] == pytest.approx(
        np.diag([1, 1 / (1 + 2 / sigma**2), 1 / (1 + 2 / sigma**2)]), rel=1e-6, abs=1e-30
    )


def test_a_known_attitude_has_the_inverse_of_its_information():
    information = np.random.default_rng(3).normal(size=(5, 3, 3))
    information = 1e4 * (information @ np.swapaxes(information, 1, 2) + np.eye(3))
    expected = 1e-6 * np.linalg.inv(information)
    assert attitude_covariances(information, 1e-6) == pytest.approx(expected, rel=1e-6, abs=1e-15)


def test_without_any_noise_what_is_known_is_known_exactly():
    assert not attitude_covariances(np.eye(3)[None], 0.0).any()


def test_an_attitude_that_is_known_about_two_axes_is_off_by_a_radian_at_most():
    """Rounding makes the information about the third negative, by more than a variance of 1e-9."""
    weak = np.array([[1e9, 1e9, 0.0], [1e9, 1e9 - 1e-6, 0.0], [0.0, 0.0, 1.0]])
    assert np.linalg.eigvalsh(weak)[0] < -1e-7
    [found] = attitude_covariances(weak[None], 1e-9)
    assert np.linalg.eigvalsh(found)[-1] == pytest.approx(1.0)
