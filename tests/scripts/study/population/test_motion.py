"""The truth of the population, against closed forms: exact Kepler orbits, Jacobi's elliptic functions, a burn."""

import numpy as np

from baryscope.models.orbit import Orbit
from baryscope.study.population.motion import relative_motion, tumble
from oracles import TorqueFree, relative_kepler

GTO = Orbit(24.4e6, 0.7, 0.4, 1.0, 2.0, 3.0)


def test_relative_motion_is_the_difference_of_two_kepler_orbits():
    state = np.array([3.0, -20.0, 5.0, 0.004, -0.007, 0.01])
    time = np.linspace(0, 40_000, 50)
    relative, R_I_L = relative_motion(GTO, state[None], time)
    expected = relative_kepler(GTO, state, time)[:, :3]
    # 1e-11 of a step, over some hundred steps, and of an eccentric orbit's growth
    np.testing.assert_allclose(np.einsum("nji,nj->ni", R_I_L, relative[0, :, :3]), expected, atol=2e-5)


def test_tumble_follows_jacobi_and_keeps_the_angular_momentum():
    moments, rate = np.array([0.1, 0.4, 0.5]), np.array([0.02, 0.03, 0.05])
    time = np.linspace(0, 600, 80)
    R, w = tumble(np.diag(moments)[None], np.array([[0.0, 0.0, 0.0, 1.0]]), rate[None], time)
    np.testing.assert_allclose(w[0], TorqueFree(np.diag(moments), rate).rate(time), atol=1e-8)
    momentum = np.einsum("nij,nj->ni", R[0], moments * w[0])
    np.testing.assert_allclose(momentum, np.tile(moments * rate, (80, 1)), atol=1e-9)


def test_a_short_burn_is_not_stepped_over():
    far = Orbit(1e9, 0.0, 0.0)  # hardly curved in 600 s

    def burn(t, here, others):
        return np.array([[0.0, 0, 0], [0.002 * (300 <= t < 305), 0, 0]])

    relative, R_I_L = relative_motion(
        far, np.array([[0.0, 10, 0, 0, 0, 0]]), np.array([0.0, 300, 600]), burn, (300, 305)
    )
    coasted, _ = relative_motion(far, np.array([[0.0, 10, 0, 0, 0, 0]]), np.array([0.0, 300, 600]))
    # v Δt = 0.01 m/s over 297.5 s; gravity's gradient over so far an orbit is 1e-9 of it
    np.testing.assert_allclose((relative - coasted)[0, 1:, :3], [[0, 0, 0], [0.01 * 297.5, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(R_I_L[0], np.eye(3), atol=1e-12)
