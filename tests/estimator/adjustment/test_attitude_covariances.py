"""Covariances of attitudes that observations determine, or not."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.normal_equations import (
    at_best_attitudes,
    attitude_covariances,
    attitude_information,
    turn_information,
)
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices, log_rotation


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


@pytest.mark.parametrize("told", [False, True], ids=["equal weights", "precisions"])
def test_attitudes_about_an_origin_that_shifts_are_as_good_as_their_information_says(told):
    """20,000 frames whose origin, far from the points, is shifted by five times the noise, more along one axis.

    The errors' covariance is to within five deviations of its elements, √(2/20,000) of one on the diagonal.
    """
    n, rng = 20_000, np.random.default_rng(11)
    points = np.array([[0.3, 0.1, 2.0], [-0.4, 0.2, 2.3], [0.1, -0.5, 1.9], [0.2, 0.4, 2.6]])
    sigma, slips = 1e-3, np.diag([5e-3, 5e-3, 2e-2])
    attitude = np.broadcast_to(np.eye(3), (n, 3, 3))
    position = points + sigma * rng.normal(size=(n, 4, 3)) + rng.normal(size=(n, 1, 3)) @ slips
    precision = np.broadcast_to(np.eye(3), (n, 4, 3, 3)) if told else None
    seen = Observations(position, np.ones((n, 4)), precision)
    shifts = FrameShifts(np.broadcast_to(slips**2 / sigma**2, (n, 3, 3)))
    found = log_rotation(at_best_attitudes(seen, attitude, np.zeros((n, 3)), points, shifts)[0])
    expected = sigma**2 * np.linalg.inv(attitude_information(seen, attitude, points, shifts)[0])
    scatter = found.T @ found / n
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(scatter / size, expected / size, rtol=0.0, atol=5 * np.sqrt(2 / n))
    about_a_point_at_rest = sigma**2 * np.linalg.inv(attitude_information(seen, attitude, points)[0])
    assert expected[0, 0] > 5 * about_a_point_at_rest[0, 0]
