"""The online estimator where the attitude is not foreseen."""

import numpy as np

from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from tops import POINTS, run, straight, tracks


def test_frames_of_a_rig_with_outliers_fit_whatever_the_attitude_is():
    """20° from frame to frame, so that none is foreseen at first, and depths thirty times as noisy as the rest.

    An attitude from three points alone, each as good in depth as across, fits hardly any other.
    """
    deviations = np.array([0.005, 0.15, 0.005])
    time = np.arange(0.0, 400.0, 6.0)
    covariance = np.tile(np.diag(deviations**2), (len(POINTS), 1, 1))
    lost = 0
    for draw in range(8):
        rng = np.random.default_rng([42, draw])
        seen = tracks(rng, time, straight(time), sigma=0.0)
        seen += deviations * rng.standard_normal(seen.shape)
        wrong = rng.random(seen.shape[:2]) < 0.15
        wrong[:2] = False
        seen[wrong] += rng.uniform(-2, 2, (wrong.sum(), 3))
        states = run(OnlineEstimator(1.0), time, seen, covariance=covariance)
        lost += sum(state.status is OnlineStatus.LOST for state in states)
    assert lost < 0.05 * 8 * len(time)
