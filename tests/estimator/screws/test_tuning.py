import numpy as np
import pytest

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.screws.motion import register_motion
from baryscope.estimator.screws.tuning import choose_cutoff, choose_lag
from synthetic import make_case


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_lag_and_cutoff_follow_the_rate_of_rotation(case_of, at_rest, noise):
    motion = register_motion(case_of(at_rest, noise=noise).tracks, None, "mean")
    trial = choose_lag(motion)
    # Long intervals: the body may turn as far as is of use.
    assert np.deg2rad(60) < trial.angle < np.deg2rad(100)
    # 3.5 °/s is about 0.0097 turns a second.
    assert choose_cutoff(motion, trial) == pytest.approx(8 * 0.0097, rel=0.2)


def test_intervals_too_short_for_a_long_lag_shorten_it(time, tumbling, features, on_v_bar):
    """Features of the turning body come into sight and go: a long lag would leave a third of the time uncovered."""
    clusters = [(t, t + 30.0, [0, 1, 2, 3]) for t in np.arange(0.0, 3000.0, 40.0)]
    clusters += [(1000.0, 1400.0, [4, 5, 6, 7])]
    case = make_case(time, tumbling, on_v_bar, features, noise=0.02, clusters=clusters)
    found = estimate(case.tracks, method="screw-gpa")
    assert found.options.lag <= 15.0
    # The bias in inertial axes, v/ω = 0.34 m along axes that swing, and no more.
    assert np.linalg.norm(found.position - case.com, axis=1).max() < 2.0
    # With a lag of 26 s only 1000 s to 1400 s are covered, and the rest is guessed.
    long = estimate(case.tracks, method="screw-gpa", options=ScrewOptions(lag=26.0))
    assert np.linalg.norm(long.position - case.com, axis=1).max() > 5.0
