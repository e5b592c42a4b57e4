"""Pushes that nobody tells, against two orbits integrated by scipy's DOP853 with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.special import iv
from scipy.stats import chi2

import free_paths
from baryscope.estimator.findings import Departure, EstimatedOrbit, UnknownPush, WrongOrbit
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.push import WAVES, with_any_push
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.result import Status
from synthetic import make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

ORBIT = free_paths.ORBIT.model()
DIRECTION = np.array([0.6, -0.64, 0.48])
TOLD = PathOptions(constant_acceleration="lvlh")
METHODS = pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])


@cache
def flown(size, axes="lvlh", variation=0.0, exponent=0.0, count=450, step=4.0):
    """Tracks with a push of a size, m/s², and the true states (count + 1, 6), the last a quarter of the time ahead."""
    time, R = free_paths.turning(count, step, 0.3)
    ahead = 1.25 * time[-1]
    true = free_paths.pushed(np.append(time, ahead), size * DIRECTION, axes, variation, exponent)
    return make_case(time, R, true[:-1, :3], free_paths.FEATURES, noise=free_paths.NOISE, seed=1).tracks, true


def assert_true(found, true):
    """Errors at the first, the middle and the last time, and ahead: of each, one in 10,000 is beyond the limit."""
    for k in (0, len(found.time) // 2, len(found.time) - 1):
        error = found.position[k] - true[k, :3]
        assert error @ np.linalg.solve(found.covariance[k], error) < chi2.isf(1e-4, 3)
    there = found.predict([1.25 * found.time[-1]])
    error = np.concatenate([there.position[0], there.velocity[0]]) - true[-1]
    assert error @ np.linalg.solve(there.covariance[0], error) < chi2.isf(1e-4, 6)


def ahead(found):
    """What is claimed of the place a quarter of the time ahead, m."""
    return float(np.sqrt(np.trace(found.predict([1.25 * found.time[-1]]).covariance[0, :3, :3])))


@pytest.mark.parametrize(("method", "size"), [("pivot", 1e-6), ("pivot", 1e-4), ("ml", 1e-6), ("ekf", 1e-4)])
def test_a_push_that_is_not_told_is_found(method, size):
    """Process noise stood for it, ten times as uncertain ahead; at 1e-4 m/s², 150 m off, it did not converge. `ml` and
    `ekf` start from what `pivot` has found.
    """
    tracks, true = flown(size)
    found = estimate(tracks, method=method, orbit=ORBIT)
    (push,) = found.findings
    assert isinstance(push, UnknownPush)
    assert push.axes == "lvlh"
    errors = np.array(push.acceleration) - size * DIRECTION
    assert (np.abs(errors) < 4 * np.array(push.acceleration_deviation)).all()
    assert found.status is Status.GOOD
    assert_true(found, true)


@pytest.mark.parametrize("size", [3e-8, 1e-7])
def test_a_push_is_found_on_an_orbit_that_the_tracks_tell(size):
    """0.93 of a revolution without an orbit file: none was found, as a path with a push lies on none."""
    tracks, true = flown(size, count=400, step=14.0)
    found = estimate(tracks)
    assert found.status is Status.GOOD
    assert {type(one) for one in found.findings} == {EstimatedOrbit, UnknownPush}
    assert_true(found, true)
    assert ahead(found) < 0.1


def test_a_push_costs_little_more_than_one_that_is_told():
    """What is told is a constant, what is found may vary by a third: ahead that is the greatest part."""
    tracks, _ = flown(1e-6)
    found, told = (
        estimate(tracks, orbit=ORBIT, options=PathOptions(constant_acceleration=one)) for one in ("none", "lvlh")
    )
    assert found.predicted_rmse < 1.2 * told.predicted_rmse
    assert ahead(found) < 4 * ahead(told)


def test_drag_that_varies_by_a_factor_of_two_goes_on_so():
    """Density of 4/3 to 2/3 of its mean; as a constant, told, it is 100 deviations off ahead."""
    tracks, true = flown(1e-5, variation=1 / 3)
    found = estimate(tracks, orbit=ORBIT)
    assert [type(one) for one in found.findings] == [UnknownPush]
    assert_true(found, true)
    told = estimate(tracks, orbit=ORBIT, options=TOLD)
    with pytest.raises(AssertionError):
        assert_true(told, true)


@pytest.mark.parametrize("size", [3e-7, 1e-6])
def test_drag_whose_logarithm_varies_goes_on_so(size):
    """Over more than a revolution, in which the air is twice as dense at the most as at the least, as by a bulge: there
    is a wave of twice the orbit's frequency, which no push had, so that process noise stood for all.
    """
    tracks, true = flown(size, exponent=0.35, step=16.0)
    found = estimate(tracks, orbit=ORBIT)
    assert [type(one) for one in found.findings] == [UnknownPush]
    assert_true(found, true)


def test_a_push_in_inertial_axes():
    """As light, over a third of an orbit, in which LVLH axes turn by 130°."""
    tracks, true = flown(1e-6, "inertial", step=5.0)
    found = estimate(tracks, orbit=ORBIT)
    (push,) = found.findings
    assert push.axes == "inertial"
    assert_true(found, true)


@pytest.mark.parametrize("seed", range(4))
def test_no_push_is_found_where_there_is_none(seed):
    """By chance one in 20,000 would be."""
    time, R = free_paths.turning(200, 4.0, 0.3)
    com = RelativeOrbit(ORBIT, 398.0).at(time).position(np.array([5.0, -20.0, 4.0, 0.0, -10.0, 4.0]))
    tracks = make_case(time, R, com, free_paths.FEATURES, noise=free_paths.NOISE, seed=seed).tracks
    assert estimate(tracks, orbit=ORBIT).findings == ()


def test_white_acceleration_is_no_push():
    """Of 1e-10 m²/s³, or 0.4 mm/s in half an hour, which process noise tells."""
    time, R = free_paths.turning(450, 4.0, 0.3)
    com = RelativeOrbit(ORBIT, 898.0).at(time).position(np.array([5.0, -20.0, 4.0, 0.0, -10.0, 4.0]))
    change = np.sqrt(1e-10 * 4.0) * np.random.default_rng(1).standard_normal((450, 3))  # of the velocity, in 4 s
    velocity = np.cumsum(change, axis=0)
    com = com + np.cumsum(4.0 * (velocity - change / 2), axis=0)
    tracks = make_case(time, R, com, free_paths.FEATURES, noise=free_paths.NOISE, seed=1).tracks
    found = estimate(tracks, orbit=ORBIT)
    assert [type(one) for one in found.findings] == [Departure]


def test_a_variation_has_no_mean_over_the_tracks():
    """So the constant part is the mean; the waves' sizes are shares of it that make a factor of two."""
    path = with_any_push(RelativeOrbit(ORBIT, 0.0), ORBIT, 0.0, 2000.0)[1]
    time = np.linspace(0.0, 2000.0, 4001)
    acceleration = path.force.acceleration(time)
    np.testing.assert_allclose(acceleration[:, :, 3:].mean(axis=0), 0.0, atol=2e-2)
    np.testing.assert_allclose(acceleration[:, :, :3].mean(axis=0), np.eye(3), atol=1e-12)
    once, twice = WAVES["cosine"], WAVES["cosine of twice the arc"]
    np.testing.assert_allclose((1 + once) / (1 - once), 2.0, rtol=1e-12)
    np.testing.assert_allclose([once, twice], 2 * iv([1, 2], 0.338) / iv(0, 0.338), rtol=0.03)  # of e^(0.338 cos u)
    np.testing.assert_allclose(path.force.deviations, [1, 1, 1, *[once / 2**0.5] * 6, *[twice / 2**0.5] * 6])


@pytest.mark.parametrize("ahead", [0.1, 0.5])
def test_an_orbit_that_is_wrong_is_no_push(ahead):
    """By so many degrees along the track, half an orbit: its gradient changes as no push does. By the greater one the
    path seems to be under J2.
    """
    time, R = free_paths.turning(450, 6.0, 0.3)
    com = RelativeOrbit(ORBIT, 1347.0).at(time).position(np.array([5.0, -20.0, 14.0, 0.0, -10.0, 4.0]))
    tracks = make_case(time, R, com, free_paths.FEATURES, noise=free_paths.NOISE, seed=1).tracks
    other = replace(ORBIT, true_anomaly=ORBIT.true_anomaly + np.deg2rad(ahead))
    found = estimate(tracks, orbit=other)
    assert [type(one) for one in found.findings] == [WrongOrbit]
