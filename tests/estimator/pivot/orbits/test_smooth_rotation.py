"""Attitudes of a smooth rotation don't hold a smooth path to where their noise has led it."""

import numpy as np
from numpy.polynomial import chebyshev

from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.trajectory import smooth_in
from baryscope.estimator.pivot.method import solve_pivot
from baryscope.estimator.pivot.orbits.smooth_rotation import by_smooth_rotation
from baryscope.estimator.pivot.reduced import of_first, scaled
from free_paths import NOISE, ORBIT, in_orbit, turning
from synthetic import box_features, make_case

FRAMES = 600


def more_squares(linear, x):
    """What the squared residuals over their variance are more by at x than where the problem is linear."""
    change = x - linear.x
    return change @ linear.information @ change - 2 * linear.rhs @ change


def test_a_path_is_held_far_less_to_where_noise_of_the_attitudes_has_led_it():
    """Features on one side turn once on a third of a revolution, and the path is asked to be a smooth one."""
    time, R = turning(FRAMES, ORBIT.period / 3 / FRAMES, 0.021)
    features = box_features(4, (1, 1, 1), seed=3, centre=(3, 2, 1))
    case = make_case(time, R, in_orbit(time), features, noise=NOISE / 2)
    found = solve_pivot(case.tracks, None, PathOptions(trajectory="polynomial"))
    off = np.linalg.norm(found.position(time) - case.com, axis=1)
    assert off.min() > 3.0
    smooth = smooth_in(found.path)
    terms = chebyshev.chebvander((2 * time - time[0] - time[-1]) / (time[-1] - time[0]), smooth.degree)
    true = np.linalg.lstsq(terms, case.com, rcond=None)[0].ravel()
    held = of_first(scaled(found.problem, found.variance), found.path.prior, found.posterior.theta, smooth.size)
    told = by_smooth_rotation(found, smooth)
    assert np.array_equal(told.x, held.x)
    assert more_squares(told, true) < more_squares(held, true) / 20
