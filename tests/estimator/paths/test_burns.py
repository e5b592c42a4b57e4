"""A path with burns is that of an integration of both bodies, and its derivatives are those of the path."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.paths.burns import Burn, BurnedPath, burns_of, untold_durations
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from burning import path_with_burns
from synthetic import Orbit

ORBIT = Orbit().model()
TIME = np.arange(0.0, 600.0, 5.0)
RHO = np.array([0.0, -20.0, 3.0, 0.0, 0.0, 0.0])
BURNS = [(100.3, 130.0, (0.01, 0.02, -0.03)), (300.0, 302.5, (-0.01, 0.0, 0.02))]


def burned(burns):
    own = tuple(Burn(begin, end, np.array(change), 0.1, (2.0, 3.0)) for begin, end, change in burns)
    return BurnedPath(RelativeOrbit(ORBIT, 0.0), ORBIT, own, TIME[0], TIME[-1])


def moved(path):
    return path.at(TIME).position(np.concatenate([RHO, path.values]))


def test_the_path_under_burns():
    # The two bodies' distance is linear in the burns but for 1e-6 of it, (20 m)²/7150 km; they move it by 8 m.
    np.testing.assert_allclose(moved(burned(BURNS)), path_with_burns(TIME, BURNS), atol=2e-4)


def test_the_path_a_kilometre_away():
    """After most of an orbit: what gravity adds beyond its gradient is then 9 cm."""
    time = np.arange(0.0, 5000.0, 100.0)
    big = [(100.0, 130.0, (0.05, 0.08, -0.03)), (2000.0, 2030.0, (0.03, -0.06, 0.04))]
    own = tuple(Burn(begin, end, np.array(change), 0.1, (2.0, 3.0)) for begin, end, change in big)
    path = BurnedPath(RelativeOrbit(ORBIT, 0.0), ORBIT, own, time[0], time[-1], RHO)
    x, true = np.concatenate([RHO, path.values]), path_with_burns(time, big)
    linear = replace(path, about=None).at(time).position(x)
    assert np.linalg.norm(true, axis=1).max() > 1000
    assert np.abs(linear - true).max() > 0.05
    np.testing.assert_allclose(path.at(time).position(x), true, atol=2e-4)
    ahead, behind = (path.at(time + 50 + step).position(x) for step in (0.05, -0.05))
    np.testing.assert_allclose(path.rate_at(time + 50).position(x), (ahead - behind) / 0.1, atol=1e-5)


@pytest.mark.parametrize(("unknown", "begins", "ends"), [(3, 1.0, 1.0), (4, -0.5, 0.5)])
def test_the_derivatives_by_middle_and_duration(unknown, begins, ends):
    step, path = 1e-3, burned(BURNS)
    ahead, behind = (
        moved(burned([(begin + sign * begins, end + sign * ends, change) for begin, end, change in BURNS]))
        for sign in (step, -step)
    )
    by_time = path.columns(TIME).reshape(len(TIME), 3, 2, 5)[..., unknown]
    speeds = [burn.speed for burn in path.burns]
    np.testing.assert_allclose(by_time @ speeds, (ahead - behind) / (2 * step), atol=2e-6)


def test_the_velocity_is_the_derivative_of_the_position():
    step, path = 0.01, burned(BURNS)
    time = TIME + 3.1  # no time at which the velocity has a kink
    ahead, behind = (path.columns(time + sign) for sign in (step, -step))
    np.testing.assert_allclose(path.columns(time, rate=True), (ahead - behind) / (2 * step), atol=1e-6)


def test_estimated_burns_have_their_units():
    path = burned(BURNS)
    shift = np.array([0, 0, 0, 2.0, 1.0]) * path.burns[1].speed
    x = np.concatenate([RHO, path.values]) + np.concatenate([np.zeros(11), shift])
    of_x = np.diag(np.concatenate([np.ones(6), path.variances]))
    _, second = burns_of(path, x, of_x)
    np.testing.assert_allclose([second.begin, second.end], [301.5, 305.0])
    np.testing.assert_allclose(second.change, BURNS[1][2])
    np.testing.assert_allclose(second.covariance, 0.01 * np.eye(3))
    # Middle ± 2 s and duration ± 3 s, independent.
    np.testing.assert_allclose([second.begin_deviation, second.end_deviation], np.hypot(2.0, 1.5))


def test_times_settle_within_the_tracks():
    path = burned([(1.0, 3.0, (0.01, 0.0, 0.0))])
    x = path.values + np.array([0, 0, 0, -50.0, 0.0]) * path.burns[0].speed
    (burn,), still = path.settled(x, 1e-6 * np.eye(5))
    assert not still
    assert burn.begin == TIME[0] < burn.end <= 3.0
    same, still = path.settled(path.values, 1e-6 * np.eye(5))
    assert still
    assert (same[0].begin, same[0].end) == (1.0, 3.0)
    assert replace(same[0], end=4.0).duration == 3.0


def test_untold_durations_are_as_wide_as_told_so_and_nothing_else_is_where_it_does_not_depend_on_them():
    """A second burn with a deviation of 4 s, held with a tenth of it, among unknowns that depend on one another."""
    path = burned(BURNS)
    path = replace(path, burns=(path.burns[0], replace(path.burns[1], untold=4.0)))
    duration, alone = 6 + 5 + 4, 7
    root = np.random.default_rng(1).standard_normal((path.size, path.size))
    root[[alone]], root[:, alone] = 0.0, 0.0
    root[alone, alone] = 1.0
    assert np.sqrt(path.variances[9]) == pytest.approx(0.4 * path.burns[1].speed)
    known = np.r_[np.zeros(6), 1 / path.variances]
    of_x = np.linalg.inv(np.linalg.inv(root @ root.T) + np.diag(known))
    column = of_x @ untold_durations(path, of_x)
    grown = of_x + column @ column.T
    assert np.sqrt(grown[duration, duration]) == pytest.approx(4.0 * path.burns[1].speed)
    assert grown[alone, alone] == of_x[alone, alone]
    # What depends on it does so as before: the regression on the duration is the same.
    np.testing.assert_allclose(
        grown[:, duration] / grown[duration, duration], of_x[:, duration] / of_x[duration, duration]
    )
    assert untold_durations(burned(BURNS), of_x).shape == (path.size, 0)
