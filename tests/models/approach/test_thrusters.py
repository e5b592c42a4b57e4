"""Commands under which wrong thrusters push as is wanted, by scipy's rotations; the rate of a camera's view."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.approach.thrusters import believable, command_for, sight_rate

WANTED = np.array([0.03, -0.02, 0.01])  # m/s²


def command(scale, misalignment):
    return np.array(ca.evalf(command_for(ca.SX(WANTED), ca.SX(scale), ca.SX(misalignment)))).ravel()


@pytest.mark.parametrize("scale", [-0.5, 0.03, 2.0])
@pytest.mark.parametrize("misalignment", [np.zeros(3), np.array([0.02, -0.01, 0.03]), np.array([1.0, -2.0, 0.5])])
def test_thrusters_that_are_wrong_push_as_is_wanted(scale, misalignment):
    pushed = (1 + scale) * Rotation.from_rotvec(misalignment).apply(command(scale, misalignment))
    np.testing.assert_allclose(pushed, WANTED, rtol=0, atol=1e-15)


def test_thrusters_that_are_right_are_told_what_is_wanted():
    """To the last bit: an input that nobody connects changes nothing."""
    np.testing.assert_array_equal(command(0.0, np.zeros(3)), WANTED)


@pytest.mark.parametrize("scale", [-1.0, -3.0])
def test_thrusters_that_push_backwards_get_a_long_command_that_is_finite(scale):
    found = command(scale, np.zeros(3))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found / np.linalg.norm(found), WANTED / np.linalg.norm(WANTED), rtol=1e-14)


@pytest.mark.parametrize(
    ("told", "counts"),
    [
        ([0.05, 0.02, -0.01, 0.03], [0.05, 0.02, -0.01, 0.03]),
        ([-1.02, 0.0, 0.0, 0.0], [-0.2, 0.0, 0.0, 0.0]),
        ([3.0, 0.0, -0.3, 0.4], [0.2, 0.0, -0.12, 0.16]),
        ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_of_what_cannot_be_so_much_counts(told, counts):
    """An estimate that failed told of thrusters that push backwards, and the command was the limit, anywhere."""
    found = believable(ca.SX(told[0]), ca.SX(told[1:]), ca.SX(0.2))
    np.testing.assert_allclose(np.array(ca.evalf(ca.vertcat(*found))).ravel(), counts, rtol=1e-15)


def test_the_view_turns_with_the_line_of_sight():
    """ω × z is its change in inertial axes, by central differences in axes that turn; ω has nothing along z."""
    position, velocity, spin = np.array([3.0, -8.0, 2.0]), np.array([0.2, 0.1, -0.3]), np.array([0.0, 0.0, 0.05])
    rate = np.array(ca.evalf(sight_rate(*(ca.SX(v) for v in (position, velocity, spin))))).ravel()

    def sight(after):
        away = -Rotation.from_rotvec(after * spin).apply(position + after * velocity)
        return away / np.linalg.norm(away)

    h = 1e-4
    np.testing.assert_allclose(np.cross(rate, sight(0.0)), (sight(h) - sight(-h)) / (2 * h), rtol=0, atol=1e-9)
    assert rate @ sight(0.0) == pytest.approx(0.0, abs=1e-15)
