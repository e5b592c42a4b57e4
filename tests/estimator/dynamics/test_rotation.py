"""Rigid-body rotation against Jacobi's closed form, scipy's DOP853 on numpy equations, and differences of these."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.dynamics.rotation import NODE_ANGLE, SHORT_NODE_ANGLE, Rotation
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.models.attitude import INERTIA_BASIS
from oracles import TorqueFree, cross, inertial_states
from synthetic import ENVISAT, MU, Orbit, attitude

# rad: a quintic over NODE_ANGLE has the error 2 (0.5/2)⁶/46080 = 1e-8 for a pure spin, some ten times that for a tumble
# (7.4e-8 at most for 250 random bodies).
INTERPOLATION = 1e-7
RATE = np.deg2rad([1.2, 2.2, 2.4])


def angles(R, S):
    return ScipyRotation.from_matrix(np.swapaxes(R, 1, 2) @ S).magnitude()


def integrated(inertia, attitude0, rate0, epoch, time, orbit=None):
    """R_C_B and ω at ascending times, all on one side of the epoch, with the gravity gradient if there is an orbit."""
    J = inertia / np.trace(inertia)
    inverse = np.linalg.inv(J)

    def slope(_, state):
        R, w = state[:9].reshape(3, 3), state[9:12]
        r, v = state[12:15], state[15:]
        distance = np.linalg.norm(r)
        r_B = R.T @ r
        torque = np.zeros(3) if orbit is None else 3 * MU / distance**5 * cross(r_B, J @ r_B)
        x, y, z = w
        spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        w_dot = inverse @ (torque - cross(w, J @ w))
        return np.concatenate([(R @ spin).ravel(), w_dot, v, -MU / distance**3 * r])

    r, v = (np.array([7e6, 0, 0]), np.array([0, 7.5e3, 0])) if orbit is None else orbit
    start = np.concatenate([attitude0.ravel(), rate0, r, v])
    order = time if time[-1] >= epoch else time[::-1]
    solved = solve_ivp(slope, (epoch, order[-1]), start, "DOP853", order, rtol=1e-12, atol=1e-13).y.T
    if order is not time:
        solved = solved[::-1]
    return solved[:, :9].reshape(-1, 3, 3), solved[:, 9:12]


def attitudes(inertia, attitude0, rate0, epoch, time, orbit):
    """R_C_B at ascending times on one or both sides of the epoch."""
    sides = [side for side in (time[time < epoch], time[time >= epoch]) if len(side)]
    return np.concatenate([integrated(inertia, attitude0, rate0, epoch, side, orbit)[0] for side in sides])


def turned(vector):
    return ScipyRotation.from_rotvec(vector).as_matrix()


@pytest.mark.parametrize("rate", [RATE, np.deg2rad([3.0, 0.3, 0.2]), np.deg2rad([0.01, 0.5, 4.0])])
def test_attitude_and_rate_agree_with_jacobi(rate):
    time = np.arange(0.0, 900.0)
    exact = TorqueFree(ENVISAT, rate)
    body = Rotation(0.0, np.eye(3), rate, ENVISAT)
    # The rate was a cubic between nodes, off by up to 1e-5; it is the slope of the quintic, whose error goes with the
    # fifth power of the angle from node to node.
    for angle, bound in ((NODE_ANGLE, 1e-6), (SHORT_NODE_ANGLE, 1e-6 / 2**5)):
        found = body.at(time, angle)
        assert angles(found.attitude, exact.attitude(time).as_matrix()).max() < INTERPOLATION
        np.testing.assert_allclose(found.rate, exact.rate(time), atol=bound * np.linalg.norm(rate))


def test_nodes_farther_apart_are_exact_enough_for_a_first_fit():
    """0.7 rad between nodes, over 300 turns about the axis of the least moment: the errors of the steps add up."""
    time, rate = np.arange(0.0, 30_000.0), np.deg2rad([3.4, 0.5, 0.8])
    found = Rotation(0.0, np.eye(3), rate, ENVISAT).try_at(time, 0.7)
    errors = angles(found.attitude, TorqueFree(ENVISAT, rate).attitude(time).as_matrix())
    assert INTERPOLATION < errors.max() < 3e-5


@settings(max_examples=12)
@given(st.integers(0, 2**32 - 1))
def test_any_body_and_rate_from_an_epoch_inside_the_span(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.1, 1, 2)
    moments = [a, b, rng.uniform(abs(a - b), a + b)]  # the triangle inequality
    axes = ScipyRotation.random(random_state=seed).as_matrix()
    inertia = axes @ np.diag(moments) @ axes.T
    rate = rng.normal(size=3) * 10 ** rng.uniform(-3, 0)
    span = 15 / np.linalg.norm(rate)
    time = np.sort(rng.uniform(0, span, 60)) + 5.1
    expected = attitude(inertia, rate, np.concatenate([[5.0], time]))
    k = 30
    # A rate between nodes has a relative error of up to 1e-6, so the rate at the new epoch is integrated.
    exact, rates = integrated(inertia, np.eye(3), rate, 5.0, time[k : k + 1])
    back = Rotation(time[k], exact[0], rates[0], inertia)
    assert angles(back.at(time).attitude, expected[1:]).max() < INTERPOLATION


def test_gravity_gradient_over_half_an_orbit():
    """Against a joint integration of attitude and orbit; the torque changes the attitude by more than five degrees."""
    orbit = Orbit(eccentricity=0.05)
    target, _ = inertial_states(orbit.model(), np.zeros(3), np.zeros(3))
    time = np.linspace(0.0, orbit.period / 2, 200)
    attitude0 = turned([0.3, -0.5, 1.0])
    exact, rates = integrated(ENVISAT, attitude0, RATE / 10, 0.0, time, target)
    found = Rotation(0.0, attitude0, RATE / 10, ENVISAT, orbit.model()).at(time)
    assert angles(found.attitude, exact).max() < INTERPOLATION
    free = Rotation(0.0, attitude0, RATE / 10, ENVISAT).at(time)
    assert angles(free.attitude, exact).max() > np.deg2rad(5)
    k = 120
    back = Rotation(time[k], exact[k], rates[k], ENVISAT, orbit.model()).at(time)
    assert angles(back.attitude, exact).max() < INTERPOLATION


@pytest.mark.parametrize("gravity_gradient", [False, True])
@pytest.mark.parametrize("span", [(-120, -1), (1, 120), (-150, 250)])
def test_sensitivities_agree_with_differences_of_an_independent_integration(gravity_gradient, span):
    orbit = Orbit(eccentricity=0.05)
    epoch = 0.0
    target = inertial_states(orbit.model(), np.zeros(3), np.zeros(3))[0] if gravity_gradient else None
    time = np.linspace(*span, 20)
    attitude0, inertia = turned([1.0, 0.2, -0.4]), ENVISAT / np.trace(ENVISAT)
    found = Rotation(epoch, attitude0, RATE, inertia, orbit.model() if gravity_gradient else None).at(time)
    directions = [(axis, np.zeros((3, 3))) for axis in np.eye(3)] + [(np.zeros(3), basis) for basis in INERTIA_BASIS]
    for column, (of_rate, of_inertia) in enumerate(directions):
        # The steps change the attitude by at most 1e-3 rad: the third order is far below 1e-5 of the sensitivity.
        step = 1e-6 if column < 3 else 1e-5
        plus, minus = (
            attitudes(inertia + h * of_inertia, attitude0, RATE + h * of_rate, epoch, time, target)
            for h in (step, -step)
        )
        vectors = ScipyRotation.from_matrix(np.swapaxes(minus, 1, 2) @ plus).as_rotvec() / (2 * step)
        np.testing.assert_allclose(found.turn[:, :, column], vectors, atol=2e-5 * np.abs(vectors).max())


def test_a_body_at_rest_and_its_sensitivity_to_the_rate():
    attitude0 = turned([0.1, 2.0, 0.3])
    time = np.array([-50.0, 0.0, 12.5, 100.0])
    found = Rotation(10.0, attitude0, np.zeros(3), ENVISAT).at(time)
    np.testing.assert_allclose(found.attitude, np.tile(attitude0, (4, 1, 1)), atol=1e-14)
    np.testing.assert_array_equal(found.rate, 0)
    expected = np.zeros((4, 3, 8))
    expected[:, :, :3] = (time - 10.0)[:, None, None] * np.eye(3)
    np.testing.assert_allclose(found.turn, expected, atol=1e-10)


def test_times_in_any_order_and_a_single_time():
    start = Rotation(100.0, np.eye(3), RATE, ENVISAT)
    time = np.array([130.0, 20.0, 100.0, 70.0])
    together = start.at(time)
    for index, moment in enumerate(time):
        alone = start.at(np.array([moment]))
        assert angles(alone.attitude, together.attitude[index : index + 1])[0] < INTERPOLATION
    np.testing.assert_allclose(together.attitude[2], np.eye(3), atol=1e-14)
    np.testing.assert_allclose(together.turn[2], 0, atol=1e-12)


def test_inertia_has_trace_one_and_impossible_ones_are_recognised():
    start = Rotation(0.0, np.eye(3), RATE, ENVISAT)
    assert np.trace(start.inertia) == pytest.approx(1, abs=1e-15)
    assert start.possible
    assert not start.changed(np.zeros(3), np.array([0, 0, 0, 0.9, 0, 0, 0, 0])).possible
    changed = start.changed(np.array([0.0, 0.0, np.pi / 2]), np.arange(1.0, 9.0) * 1e-3)
    np.testing.assert_allclose(changed.attitude, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(changed.rate - RATE, [1e-3, 2e-3, 3e-3], atol=1e-15)
    difference = changed.inertia - start.inertia
    np.testing.assert_allclose(np.einsum("kij,ij->k", INERTIA_BASIS, difference), np.arange(4, 9) * 1e-3, atol=1e-15)
    assert np.trace(difference) == pytest.approx(0, abs=1e-15)


def test_the_inertia_basis_is_orthonormal_symmetric_and_traceless():
    np.testing.assert_allclose(np.einsum("aij,bij->ab", INERTIA_BASIS, INERTIA_BASIS), np.eye(5), atol=1e-15)
    np.testing.assert_array_equal(INERTIA_BASIS, np.swapaxes(INERTIA_BASIS, 1, 2))
    np.testing.assert_allclose(np.trace(INERTIA_BASIS, axis1=1, axis2=2), 0, atol=1e-15)


@given(st.integers(0, 2**32 - 1), st.floats(-12, 0.49))
def test_exp_agrees_with_scipy_and_log_is_its_inverse(seed, exponent):
    """Angles from 1e-12 to 3.1 rad."""
    vector = np.random.default_rng(seed).normal(size=(5, 3))
    vector *= 10**exponent / np.linalg.norm(vector, axis=1, keepdims=True)
    R = exp_rotation(vector)
    np.testing.assert_allclose(R, ScipyRotation.from_rotvec(vector).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(log_rotation(R), vector, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(exp_rotation(np.zeros((2, 4, 3))), np.broadcast_to(np.eye(3), (2, 4, 3, 3)))


def test_log_of_a_rotation_by_pi():
    axes = np.random.default_rng(0).normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    found = log_rotation(2 * axes[:, :, None] * axes[:, None, :] - np.eye(3))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.pi, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(found * axes, axis=1)), np.pi, atol=1e-12)
