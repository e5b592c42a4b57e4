"""A frame is registered alike wherever the target is: the truth is the same tracks, moved as a whole."""

import numpy as np

from baryscope.estimator.online import OnlineEstimator
from tops import FRAMES, SIGMA, run, straight, tracks

FAR = np.array([1e5, 0.0, 0.0])  # m, of which the last digit is 1.5e-11 m
SAME = 1e-7  # m: steps of 1e-8 rad are left out, of features some metres from the centre of mass


def test_a_target_far_away_has_the_same_centre_of_mass():
    """The first step began at the origin of the axes, with residuals as long as the range: it turned features where
    these put them, and what was left of that moved the centre of mass far more than rounding."""
    time = np.arange(float(FRAMES))
    seen = tracks(np.random.default_rng(90), time, straight(time))
    here, there = (run(OnlineEstimator(SIGMA), time, seen + shift)[-1] for shift in (0.0, FAR))
    assert here.status == there.status == "tracking"
    np.testing.assert_allclose(there.position - FAR, here.position, rtol=0, atol=SAME)
