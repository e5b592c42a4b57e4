"""The forced rotation against scipy's DOP853 on numpy equations, and differences of these; orthonormal modes."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, Rotation
from baryscope.estimator.dynamics.torque import GAUSS, LastingTorque, Torque, stage_weights
from synthetic import ENVISAT

RATE = np.deg2rad([1.2, 2.2, 2.4])
INERTIA = ENVISAT / np.trace(ENVISAT)
EPOCH, TIME = 90.0, np.linspace(0.0, 200.0, 41)


def acceleration(coefficients, time):
    """Σ ξⱼ aⱼ(t) by its definition in the module's docstring."""
    found = coefficients[0] / np.sqrt(TIME[-1])
    for j in range(1, len(coefficients)):
        found = found + coefficients[j] * np.sqrt(2 / TIME[-1]) * np.cos(j * np.pi * time / TIME[-1])
    return found


def attitudes(inertia, rate, coefficients):
    """R_C_B at TIME, and ω, from the epoch both ways."""

    def slope(time, state):
        R, w = state[:9].reshape(3, 3), state[9:]
        x, y, z = w
        spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        w_dot = np.linalg.solve(inertia, -np.cross(w, inertia @ w)) + acceleration(coefficients, time)
        return np.concatenate([(R @ spin).ravel(), w_dot])

    start = np.concatenate([np.eye(3).ravel(), rate])
    sides = []
    for order in (TIME[TIME < EPOCH][::-1], TIME[TIME >= EPOCH]):
        solved = solve_ivp(slope, (EPOCH, order[-1]), start, "DOP853", order, rtol=1e-12, atol=1e-13).y.T
        sides.append(solved if order[0] >= EPOCH else solved[::-1])
    states = np.concatenate(sides)
    return states[:, :9].reshape(-1, 3, 3), states[:, 9:]


@pytest.fixture(scope="module")
def coefficients():
    """Of six modes; a spin-up by a tenth of the rate or so."""
    return 5e-4 * np.random.default_rng(0).normal(size=(6, 3))


def test_attitude_and_rate_under_a_torque(coefficients):
    found = Rotation(EPOCH, np.eye(3), RATE, INERTIA, torque=Torque(TIME[0], TIME[-1], coefficients, np.arange(6))).at(
        TIME
    )
    exact, rate = attitudes(INERTIA, RATE, coefficients)
    free = Rotation(EPOCH, np.eye(3), RATE, INERTIA).at(TIME)
    assert ScipyRotation.from_matrix(np.swapaxes(free.attitude, 1, 2) @ exact).magnitude().max() > 0.3
    # A cubic for the torque within a step: an error of 1e-4 of the fastest mode's effect.
    assert ScipyRotation.from_matrix(np.swapaxes(found.attitude, 1, 2) @ exact).magnitude().max() < 1e-5
    np.testing.assert_allclose(found.rate, rate, atol=1e-4 * np.linalg.norm(RATE))


def test_sensitivity_to_the_modes(coefficients):
    start = Rotation(EPOCH, np.eye(3), RATE, INERTIA, torque=Torque(TIME[0], TIME[-1], coefficients, np.arange(6)))
    motion = start.at(TIME)
    found, rate = motion.turn, np.swapaxes(motion.attitude, 1, 2) @ motion.rate_sensitivity_in_C(TIME)
    step = 1e-6
    for mode, axis in ((0, 0), (2, 1), (5, 2)):
        change = np.zeros_like(coefficients)
        change[mode, axis] = step
        (minus, slower), (plus, faster) = (attitudes(INERTIA, RATE, coefficients + sign * change) for sign in (-1, 1))
        vectors = ScipyRotation.from_matrix(np.swapaxes(minus, 1, 2) @ plus).as_rotvec() / (2 * step)
        column = RATE_AND_INERTIA + 3 * mode + axis
        np.testing.assert_allclose(found[:, :, column], vectors, atol=1e-4 * np.abs(vectors).max())
        expected = (faster - slower) / (2 * step)
        # The slope of a cubic between nodes.
        np.testing.assert_allclose(rate[:, :, column], expected, atol=5e-3 * np.abs(expected).max())


def test_no_torque_with_modes_is_free():
    free = Rotation(EPOCH, np.eye(3), RATE, INERTIA)
    found = Rotation(EPOCH, np.eye(3), RATE, INERTIA, torque=Torque.none(TIME[0], TIME[-1], np.arange(3)))
    assert (free.size, found.size) == (8, 17)
    both = free.at(TIME), found.at(TIME)
    np.testing.assert_allclose(both[0].attitude, both[1].attitude, atol=1e-13)
    np.testing.assert_allclose(both[0].turn, both[1].turn[:, :, :8], atol=1e-9)
    changed = found.changed(np.zeros(3), np.arange(17.0) * 1e-4)
    assert changed.torque is not None
    np.testing.assert_allclose(changed.torque.coefficients.ravel(), np.arange(8.0, 17.0) * 1e-4)


def test_modes_are_orthonormal():
    torque = Torque.none(3.0, 10.0, np.array([0, 1, 3, 4]))
    for i in range(4):
        for j in range(i + 1):
            product = quad(lambda t, i=i, j=j: np.prod(torque.modes(np.array(t))[[i, j]]), 3.0, 10.0)[0]
            assert product == pytest.approx(float(i == j), abs=1e-10)
    np.testing.assert_array_equal(torque.modes(np.array([-20.0, 30.0])), 0.0)


def test_a_cubic_is_interpolated_exactly():
    for fraction in (0.0, 0.3, 1.0):
        values = 1 - 2 * GAUSS + 3 * GAUSS**2 - 4 * GAUSS**3
        assert stage_weights(fraction) @ values == pytest.approx(1 - 2 * fraction + 3 * fraction**2 - 4 * fraction**3)


def test_the_impulse_bounds_the_change_of_the_rate():
    constant = Torque(0.0, 100.0, np.array([[3e-4, 0, 4e-4]]), np.array([0]))
    assert constant.impulse() == pytest.approx(5e-4 * np.sqrt(100.0))


def test_more_modes_leave_the_torque_as_it_is(coefficients):
    few = Torque(0.0, 50.0, coefficients[:2], np.array([1, 5]))
    more, time = few.with_orders(np.array([0, 1, 2, 5, 8])), np.linspace(0.0, 50.0, 7)
    assert more.size == 15
    np.testing.assert_allclose(more.at(time), few.at(time), atol=1e-18)


def test_of_white_noise_little_lasts_and_of_a_steady_torque_all():
    """Draws of white noise: it is taken for one that lasts less than every other time, and then for half of itself at
    most on average. Of a torque whose mean is n deviations of the noise, all but one part in n² lasts.
    """
    rng, density, duration = np.random.default_rng(7), 1e-10, 500.0
    drawn = np.sqrt(density * duration) * rng.standard_normal((2000, 3))
    found = [(LastingTorque.of(one, np.zeros((3, 3)), density, duration), one / duration) for one in drawn]
    kept = [np.linalg.norm(lasting.mean) / np.linalg.norm(whole) for lasting, whole in found if lasting is not None]
    assert 0.36 < len(kept) / len(found) < 0.42  # P(χ²₃ > 3) = 0.392, four deviations either way
    assert np.mean(kept) < 0.5
    steady = 10 * np.sqrt(density / duration) * np.array([1.0, -1.0, 1.0])
    lasting = LastingTorque.of(steady * duration, np.zeros((3, 3)), density, duration)
    np.testing.assert_allclose(lasting.mean, 0.99 * steady, rtol=1e-12)
    assert LastingTorque.of(steady * duration, np.zeros((3, 3)), 0.0, duration) is None
