"""The online estimator on an orbit under J2: the truth is two bodies that fall by a gravity written down again."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from baryscope.models.errors import InputError
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS, Orbit
from oracles import fallen
from tops import SIGMA, errors, run, tracks

PLAIN = Orbit(7.15e6, 0.001, 1.72, 2.1, 1.57, 0.5)
OBLATE = replace(PLAIN, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)
HOLD = np.array([0.0, -20.0, 0.0]), np.array([0.002, 0.001, -0.003])
ALPHA = 1e-4  # of the chi-square bands


def path_from(begin, time):
    """The path (n, 3) of the target from the chaser at times (n,) after `begin`, s, from time 0 of the orbit."""
    return fallen(PLAIN, *HOLD, begin + time)[:, :3]


def test_on_a_whole_orbit_j2_that_is_told_costs_nothing():
    """Told, errors are a few times smaller than untold, where they are bridged by process noise, and claims hold."""
    time, draws = 10.0 * np.arange(600), 4
    path, last = path_from(0.0, time), {"told": [], "untold": []}
    for draw in range(draws):
        seen = tracks(np.random.default_rng([7, draw]), time, path)
        for name, orbit in (("told", OBLATE), ("untold", PLAIN)):
            states = run(OnlineEstimator(SIGMA, orbit), time, seen)
            assert states[-1].status is OnlineStatus.TRACKING
            last[name].append([one[-1] for one in errors(states[-1:], path[-1:])])
    told, untold = (np.array(last[name]).T for name in ("told", "untold"))
    assert told[1].sum() < chi2.ppf(1 - ALPHA, 3 * draws)
    # Errors of four draws of three coordinates each may be smaller by chance by a factor of three in the squares.
    assert np.mean(untold[0] ** 2) > 9 * np.mean(told[0] ** 2)


@pytest.mark.parametrize("begin", [0.0, 4000.0])
def test_predictions_go_on_under_j2(begin):
    """Half an orbit ahead of 200 frames, after which J2 alone has moved the target by metres; the orbit's elements are
    those of time 0, whenever the first frame is."""
    time, ahead, sigma = np.arange(200.0), 3000.0, 1e-4
    path = path_from(begin, np.concatenate([time, time[-1:] + ahead]))
    seen = tracks(np.random.default_rng(8), time, path[:-1], sigma=sigma)
    off = {}
    for orbit in (PLAIN, OBLATE):
        filter = OnlineEstimator(sigma, orbit)
        run(filter, begin + time, seen)
        state = filter.predict(begin + time[-1] + ahead)
        error = state.position - path[-1]
        off[orbit.j2] = np.linalg.norm(error), error @ np.linalg.solve(state.covariance[:3, :3], error)
    assert off[EARTH_J2][1] < chi2.ppf(1 - ALPHA, 3)
    assert off[None][0] > 20 * off[EARTH_J2][0]


def test_frames_that_show_too_little_leave_the_orbit_where_it_is():
    """Frames that begin nothing, before the first that does, at any times."""
    time = 1000.0 + np.arange(40.0)
    seen = tracks(np.random.default_rng(9), time, path_from(0.0, time))
    alone, after = OnlineEstimator(SIGMA, OBLATE), OnlineEstimator(SIGMA, OBLATE)
    for early in (300.0, -500.0, 700.0):
        assert after.update(early, seen[0, :2]).status is OnlineStatus.WAITING
    one, other = run(alone, time, seen)[-1], run(after, time, seen)[-1]
    np.testing.assert_allclose(other.position, one.position, rtol=1e-9)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-6, atol=1e-9)


def test_it_goes_on_from_what_was_saved_to_the_last_bit():
    time = np.arange(60.0)
    seen = tracks(np.random.default_rng(10), time, path_from(0.0, time))
    filter = OnlineEstimator(SIGMA, OBLATE)
    run(filter, time[:30], seen[:30])
    other = OnlineEstimator.restored(filter.save())
    for one in (filter, other):
        run(one, time[30:], seen[30:])
    assert one.save() == filter.save()


def test_without_j2_it_is_the_same_filter_whether_that_is_said_or_not():
    filters = [OnlineEstimator(SIGMA, orbit) for orbit in (PLAIN, replace(OBLATE, j2=0.0))]
    time = np.arange(40.0)
    seen = tracks(np.random.default_rng(11), time, path_from(0.0, time))
    one, other = (run(filter, time, seen)[-1] for filter in filters)
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.covariance, other.covariance)


def test_an_ephemeris_does_not_count():
    class Nowhere:
        def states(self, time):
            raise AssertionError("asked")

    plain, told = (OnlineEstimator(SIGMA, orbit) for orbit in (OBLATE, replace(OBLATE, ephemeris=Nowhere())))
    assert plain.save() == told.save()


def test_times_to_which_j2_is_not_followed_are_refused():
    time = np.arange(10.0)
    seen = tracks(np.random.default_rng(12), time, path_from(0.0, time))
    filter = OnlineEstimator(SIGMA, OBLATE)
    with pytest.raises(InputError, match=r"time: found -20000000.0 s, expected one within 1e\+07 s of the last frame"):
        filter.update(-2e7, seen[0])
    run(filter, time, seen)
    before = filter.save()
    for asked in (filter.predict, lambda time: filter.point(0, time)):
        with pytest.raises(InputError, match=r"found 20000000.0 s, expected one within 1e\+07 s"):
            asked(2e7)
    assert filter.save() == before
    assert OnlineEstimator(SIGMA, PLAIN).update(2e7, seen[0]).status is OnlineStatus.STARTING
