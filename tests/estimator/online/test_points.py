"""Where a feature will be, by the online estimator, long after the last frame."""

import numpy as np
from scipy.stats import chi2

import oracles
from baryscope.estimator.online import OnlineEstimator
from baryscope.models.orbit import Orbit
from tops import POINTS, attitudes, run, tracks

ORBIT = Orbit(7.2e6, 0.1, 1.7, 2.0, 1.5, 0.4)
DRAWS, ALPHA = 12, 1e-4
NOISE = 0.06  # m: after 300 s the attitude is uncertain by a quarter of a radian
AHEAD, FEATURE = 300.0, 2


def path_of(time):
    """The path (n, 3) as the difference of two Kepler orbits."""
    bodies = oracles.inertial_states(ORBIT, [2.0, -20.0, 1.0], [0.005, 0.002, -0.003])
    places = [[oracles.propagate_kepler(*body, ORBIT.gravitational_parameter, t)[0] for body in bodies] for t in time]
    return np.array([here - there for here, there in places], dtype=float)


def test_a_feature_is_foreseen_on_an_arc():
    """To first order the error along the arm was none: of these draws one had a NEES of 37."""
    time = np.arange(130.0)
    path, then = path_of(time), time[-1:] + AHEAD
    place = path_of(then)[0] + attitudes(then)[0] @ POINTS[FEATURE]
    nees = []
    for draw in range(DRAWS):
        filter = OnlineEstimator(NOISE, ORBIT)
        run(filter, time, tracks(np.random.default_rng([91, draw]), time, path, sigma=NOISE))
        position, covariance = filter.point(FEATURE, then[0])
        nees.append((position - place) @ np.linalg.solve(covariance, position - place))
    assert max(nees) < chi2.isf(ALPHA / DRAWS, 3)
