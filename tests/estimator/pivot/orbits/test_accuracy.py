"""Answers that rest on how exact the orbit is: along the axis of a spin the gravity gradient alone tells the place."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.findings import EstimatedOrbit, UntoldAccuracy, UntoldOblateness, WrongOrbit
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.push import untold_push
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.study.population.judging import of_estimate, prepared, wrong
from baryscope.study.world.judging import prepared as world_prepared
from oracles import fallen, oblate_gravity
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

ORBIT = Orbit().model().of_simulation()
TIME = np.arange(0.0, 600.0, 2.0)
COM = RelativeOrbit(ORBIT, 300.0).at(TIME).position(np.array([5.0, -20.0, 4.0, 0.0, -10.0, 4.0]))
SPIN = Rotation.from_rotvec(np.outer(0.05 * TIME, [0.0, 0.0, 1.0])).as_matrix()
TURN = np.deg2rad(0.3)
AHEAD = replace(ORBIT, true_anomaly=ORBIT.true_anomaly + TURN)
# `ml` and `ekf` start from `pivot`, which finds the orbit's error by itself in the second draw, in the first not.
DRAWS = pytest.mark.parametrize(("method", "draws"), [("pivot", 2), ("ml", 1), ("ekf", 1)], ids=["pivot", "ml", "ekf"])


def spinning(seed):
    return make_case(TIME, SPIN, COM, box_features(8, (10, 4, 4), 1), noise=0.005, seed=seed).tracks


def along_axis(found):
    """Error and standard deviation along the axis, in the middle, m."""
    k = len(TIME) // 2
    return found.position[k, 2] - COM[k, 2], np.sqrt(found.covariance[k, 2, 2])


@DRAWS
def test_what_nobody_tells_of_the_orbit_is_allowed_for(method, draws):
    """Beyond four deviations none is; claimed to be exact, the orbit puts those 10 off where none finds it."""
    exact = []
    for seed in range(draws):
        tracks = spinning(seed)
        untold = estimate(tracks, orbit=replace(AHEAD, accuracy=None), method=method)
        error, deviation = along_axis(untold)
        assert abs(error) < 4 * deviation
        assert any(isinstance(one, UntoldAccuracy | WrongOrbit) for one in untold.findings)
        told = estimate(tracks, orbit=replace(AHEAD, accuracy=TURN * ORBIT.semi_major_axis), method=method)
        error, deviation = along_axis(told)
        assert abs(error) < 4 * deviation
        assert not any(isinstance(one, UntoldAccuracy) and one.place for one in told.findings)
        error, deviation = along_axis(estimate(tracks, orbit=AHEAD, method=method))
        exact.append(abs(error) / deviation)
    assert np.max(exact) > 10


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_an_accuracy_that_is_told_holds_without_process_noise(method):
    """It was left out: 0.18 m off, with a claim of 4 mm."""
    told, options = replace(AHEAD, accuracy=TURN * ORBIT.semi_major_axis), PathOptions(process_noise="none")
    error, deviation = along_axis(estimate(spinning(0), orbit=told, method=method, options=options))
    assert (error / deviation) ** 2 < chi2.isf(1e-4, 1)
    error, deviation = along_axis(estimate(spinning(0), orbit=AHEAD, method=method, options=options))
    assert (error / deviation) ** 2 > chi2.isf(1e-4, 1)


@DRAWS
def test_an_orbit_that_is_exact_is_taken_at_its_word(method, draws):
    """Of the normalised squares along the axis none is beyond 1e-4; claimed to centimetres, of a body of ten metres."""
    for seed in range(draws):
        error, deviation = along_axis(estimate(spinning(seed), orbit=ORBIT, method=method))
        assert deviation < 0.01
        assert (error / deviation) ** 2 < chi2.isf(1e-4, 1)


def test_drag_that_nobody_tells_is_allowed_for():
    """A sixth of a turn at 450 km: `population case --population third --seed 24 --index 77 --method pivot --orbit` had
    a NEES of 239.
    """
    case, sample, _ = prepared(24, 77, "third")
    found = estimate(sample.tracks, orbit=case.orbit)
    (finding,) = found.findings
    assert finding.push == pytest.approx(untold_push(case.orbit))
    assert not wrong(of_estimate(found, case.path))


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_an_error_that_the_tracks_all_but_exclude_moves_the_answer_little(method):
    """A whole orbit tells most of its errors. As an unknown of the size that is just not excluded, these moved the path
    by nearly as much as is claimed without.
    """
    made = world_prepared("J2, one orbit", 1, 7)[0]
    orbit = made.orbit.with_earths_j2()
    untold, exact = (estimate(made.tracks, orbit=replace(orbit, accuracy=one), method=method) for one in (None, 0.0))
    assert any(isinstance(one, UntoldAccuracy) for one in untold.findings)
    apart = np.sqrt(np.sum((untold.position - exact.position) ** 2, axis=1).mean())
    assert apart < 0.5 * exact.predicted_rmse < 0.5 * untold.predicted_rmse


def test_a_push_is_less_the_higher_the_orbit():
    """Drag between 450 and 700 km as the density of Vallado's table 8-4 there, to a third; then light alone."""
    circles = (replace(ORBIT, semi_major_axis=EARTH_RADIUS + 1e3 * one, eccentricity=0.0) for one in (450, 700))
    push = [untold_push(orbit) for orbit in circles]
    assert (push[1] - 1e-7) / (push[0] - 1e-7) == pytest.approx(3.614e-14 / 1.585e-12, rel=1 / 3)
    assert untold_push(replace(ORBIT, semi_major_axis=42e6)) == pytest.approx(1e-7, rel=1e-3)


def test_a_tumble_rests_on_no_orbit():
    """Features that turn about all axes tell the centre of mass: nothing is allowed for, and the claim stays."""
    R = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), TIME)
    tracks = make_case(TIME, R, COM, box_features(8, (10, 4, 4), 1), noise=0.02, seed=3).tracks
    untold, exact = (estimate(tracks, orbit=replace(ORBIT, accuracy=one)) for one in (None, 0.0))
    assert untold.findings == ()
    np.testing.assert_array_equal(untold.covariance, exact.covariance)


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_an_error_of_the_orbit_that_does_not_show_counts_ahead(method):
    """60 m off on V-bar for a third of a revolution, on an orbit that is told 150 m too wide.

    In the tracks the answer is that of an orbit that is claimed to be exact. Ahead of them, by a quarter of their time
    and by all of it, no squared error is beyond 1e-4, as that claim's are.
    """
    time = np.linspace(0.0, 2000.0, 300)
    every = np.append(time, [2500.0, 4000.0])
    com = fallen(ORBIT, np.array([0.0, -60.0, 0.0]), np.zeros(3), every, partial(oblate_gravity, j2=0.0))[:, :3]
    R = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), time)
    tracks = make_case(time, R, com[:-2], box_features(8, (10, 4, 4), 1), noise=0.01, seed=2).tracks
    wide = replace(ORBIT, semi_major_axis=ORBIT.semi_major_axis + 150.0)
    untold, exact = (estimate(tracks, orbit=replace(wide, accuracy=one), method=method) for one in (None, 0.0))
    np.testing.assert_array_equal(untold.covariance, exact.covariance)
    np.testing.assert_array_equal(untold.predict(time).covariance, exact.predict(time).covariance)
    squares = []
    for found in (untold, exact):
        ahead = found.predict(every[-2:])
        error = (ahead.position - com[-2:])[:, :, None]
        squares.append((np.swapaxes(error, 1, 2) @ np.linalg.solve(ahead.covariance[:, :3, :3], error))[:, 0, 0])
    assert squares[0].max() < chi2.isf(1e-4, 3) < squares[1].max()


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_j2_that_nobody_tells_and_that_does_not_show_counts_ahead(method):
    """20 m off on V-bar for a tenth of a revolution, on an orbit that is told exactly, but without J2.

    In the tracks J2 moves the answer by less than two deviations, so that it is that on an orbit that is told to have
    none. Ahead of them, by all of their time, position and velocity together have no squared error beyond 1e-3, and
    beyond 1e-6 on an orbit that is told so, as they had on one that does not tell.
    """
    time = np.linspace(0.0, 600.0, 240)
    every = np.append(time, 1200.0)
    state = fallen(ORBIT, np.array([0.0, -20.0, 0.0]), np.zeros(3), every, oblate_gravity)
    R = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), time)
    tracks = make_case(time, R, state[:-1, :3], box_features(8, (10, 4, 4), 1), noise=0.05, seed=2).tracks
    silent = replace(ORBIT, j2=None, equatorial_radius=None)
    untold, none = (estimate(tracks, orbit=one, method=method) for one in (silent, ORBIT))
    np.testing.assert_array_equal(untold.covariance, none.covariance)
    np.testing.assert_array_equal(untold.predict(time).covariance, none.predict(time).covariance)
    squares = []
    for found in (untold, none):
        ahead = found.predict(every[-1:])
        error = np.concatenate([ahead.position[0], ahead.velocity[0]]) - state[-1]
        squares.append(error @ np.linalg.solve(ahead.covariance[0], error))
    assert squares[0] < chi2.isf(1e-3, 6)
    assert squares[1] > chi2.isf(1e-6, 6)


@pytest.mark.parametrize("noise", ["auto", "none"])
@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_an_orbit_that_the_tracks_tell_may_be_under_j2(method, noise):
    """A spin, watched for a third of a revolution without an orbit: the gradient tells the place along the axis.

    J2 moved that by 0.12 m, with a claim of 0.03 m (squared error 24). Without process noise it was not asked about
    until later: the claim was 7 mm (squared error 451), though J2 is no noise.
    """
    time, com = falling(oblate_gravity)
    found = estimate(about_z(time, com, 0), method=method, options=PathOptions(process_noise=noise))
    assert UntoldOblateness(EARTH_J2, certain=True) in found.findings
    assert any(isinstance(one, EstimatedOrbit) for one in found.findings)
    assert squared_error(found, com) < chi2.isf(1e-4, 3)
    assert np.linalg.norm(found.position - com, axis=1).max() < 0.06


def test_an_orbit_that_the_tracks_tell_may_be_without_j2():
    """Where there is none, it is excluded, or allowed for."""
    time, com = falling(partial(oblate_gravity, j2=0.0))
    found = estimate(about_z(time, com, 0))
    assert UntoldOblateness(EARTH_J2, certain=True) not in found.findings
    assert squared_error(found, com) < chi2.isf(1e-4, 3)


def about_z(time, com, seed):
    R = Rotation.from_rotvec(np.outer(0.02 * time, [0.0, 0.0, 1.0])).as_matrix()
    return make_case(time, R, com, box_features(8, (10, 4, 4), 1), noise=0.003, seed=seed).tracks


def squared_error(found, com):
    k = len(com) // 2
    error = found.position[k] - com[k]
    return error @ np.linalg.solve(found.covariance[k], error)


@cache
def falling(gravity):
    """Times, and the target (n, 3) from the chaser, both of which fall in inertial axes by a gravity."""
    time = np.arange(0.0, 2000.0, 4.0)
    return time, fallen(ORBIT, np.array([5.0, -30.0, 4.0]), np.array([0.0, 0.01, 0.004]), time, gravity)[:, :3]


def test_an_orbit_that_is_off_by_less_than_what_is_likely_is_allowed_for_too():
    """By 198 m in the semi-major axis, for a turn in 11 minutes: the tracks exclude 0.2°, and not a tenth of it, with
    which the claim is three times as wide. The answer had a NEES of 77.
    """
    case, sample, _ = prepared(52, 21, "third")
    found = estimate(sample.tracks, orbit=case.orbit)
    (finding,) = [one for one in found.findings if isinstance(one, UntoldAccuracy)]
    assert finding.place < 0.11 * np.deg2rad(0.2) * case.orbit.semi_major_axis
    assert not wrong(of_estimate(found, case.path))
