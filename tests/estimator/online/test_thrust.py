"""The online estimator while the chaser accelerates on an orbit, against its motion by scipy's DOP853."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import oracles
from baryscope.estimator.online import OnlineEstimator
from baryscope.models.orbit import Orbit
from tops import SIGMA, run, straight, tracks

ACCELERATION = np.array([2e-3, -1e-3, 5e-4])  # m/s²
ORBIT = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
LAST = 59.0  # s


def displaced(ahead):
    """By how much the acceleration moves the chaser in a time in s, m."""
    mu = ORBIT.gravitational_parameter
    _, start = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    state = np.concatenate(oracles.propagate_kepler(*start, mu, LAST)).astype(float)
    ends = [
        solve_ivp(
            lambda _, y, a=acceleration: np.concatenate([y[3:], a - mu * y[:3] / np.linalg.norm(y[:3]) ** 3]),
            (0.0, ahead),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=1e-9,
        ).y[:3, -1]
        for acceleration in (ACCELERATION, np.zeros(3))
    ]
    return ends[0] - ends[1]


@pytest.mark.parametrize("ahead", [20.0, 120.0])
def test_gravity_acts_on_what_an_acceleration_displaces(ahead):
    """Without it the prediction is off by 4 mm after 120 s."""
    time = np.arange(LAST + 1)
    filter = OnlineEstimator(SIGMA, ORBIT)
    run(filter, time, tracks(np.random.default_rng(8), time, straight(time)))
    moved = filter.predict(LAST + ahead, ACCELERATION).position - filter.predict(LAST + ahead).position
    np.testing.assert_allclose(moved, -displaced(ahead), atol=2e-4)
