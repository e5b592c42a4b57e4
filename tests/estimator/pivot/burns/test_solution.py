"""Burns that nothing told are found, bridged and listed; where there are none, none is found."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.document.document import document_of
from baryscope.estimator.findings import EstimatedOrbit, UnknownBurn
from baryscope.estimator.methods import estimate
from baryscope.estimator.ml import iteration, jacobians
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths import interpolated_path
from baryscope.estimator.pivot import refinement
from baryscope.estimator.result import Status
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.study.population.cases import drawn
from baryscope.study.population.sensing import sampled
from burning import path_with_burns, tracks_of_faces
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

ORBIT = Orbit().model()
TIME = np.arange(0.0, 500.0, 2.0)
LONG, SHORT = (97.0, 121.0, (0.015, -0.03, 0.01)), (330.5, 332.5, (-0.004, 0.006, 0.002))
BLACKOUT = (80.0, 150.0)


@cache
def turning():
    return attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), TIME)


@cache
def path(burns):
    return path_with_burns(TIME, burns)


def case(burns, seed=5, seen=None):
    seen = np.ones(len(TIME), bool) if seen is None else seen
    features = box_features(8, (10, 4, 4), 1)
    return make_case(TIME[seen], turning()[seen], path(burns)[seen], features, noise=0.02, seed=seed)


@cache
def found_on_orbit(burns, method="pivot"):
    """The estimate of the case of burns, which several tests look at."""
    return estimate(case(burns).tracks, method=method, orbit=ORBIT)


def in_C(burns):
    """The burns with changes in C, as long as they are short."""
    R = [Orbit().R_I_L(np.array([(begin + end) / 2]))[0] for begin, end, _ in burns]
    return tuple((begin, end, tuple(axes @ change)) for axes, (begin, end, change) in zip(R, burns, strict=True))


def burns_in(found):
    assert {type(one) for one in found.findings} <= {UnknownBurn}
    return found.findings


def assert_found(found, burns):
    """The burns, to within 4.5 standard deviations."""
    assert len(burns_in(found)) == len(burns)
    for one, (begin, end, change) in zip(burns_in(found), burns, strict=True):
        assert abs(one.begin - begin) < 4.5 * one.begin_deviation
        assert abs(one.end - end) < 4.5 * one.end_deviation
        assert (np.abs(np.subtract(one.change, change)) < 4.5 * np.array(one.change_deviation)).all()


def nees(found, com):
    error = found.position - com
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)


METHODS = pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])


@METHODS
def test_two_burns(method):
    made, found = case((LONG, SHORT)), found_on_orbit((LONG, SHORT), method)
    assert found.status is Status.GOOD
    assert_found(found, (LONG, SHORT))
    assert found.process_noise.negligible
    # χ²/n of one path, all of whose errors hang together, stays below 12 in 99 %.
    assert nees(found, made.com).mean() < 12
    assert np.sqrt(((found.position - made.com) ** 2).sum(axis=1).mean()) < 0.01


def test_burns_that_take_more_rounds_are_found(monkeypatch):
    """Three do for a path, not for one with burns: what was far likelier was dropped, as it had not converged."""
    monkeypatch.setattr(refinement, "MAX_ROUNDS", 3)
    found = estimate(case((LONG, SHORT)).tracks, orbit=ORBIT)
    assert found.status is Status.GOOD
    assert_found(found, (LONG, SHORT))


PULSES = (
    (70.0, 74.0, (-0.008, -0.0015, 0.0045)),
    (187.0, 192.0, (0.0055, -0.001, -0.007)),
    (300.0, 303.0, (-0.003, 0.002, 0.002)),
)


def test_pulses_of_a_chaser_that_holds_its_place():
    """The refinement began from the search's path without the slow accelerations beside which it had been fitted: off
    by a decimetre, it ended far from the burns, and all was left to process noise.
    """
    time = np.arange(0.0, 400.0)
    com = path_with_burns(time, PULSES)
    found = estimate(tracks_of_faces(time, com, (0.4, 2.0, 1.2), 14, seed=2, baseline=0.4), orbit=ORBIT)
    bridged = [one for one in found.findings if isinstance(one, UnknownBurn)]
    assert_found(replace(found, findings=tuple(bridged)), PULSES)
    assert found.process_noise.negligible
    assert nees(found, com).mean() < 12


def test_the_attitudes_of_a_tumble_show_burns_that_free_ones_hide():
    """By a baseline of 0.3 m depths are known to half a metre, attitudes by a frame alone to a tenth of a radian."""
    pulses, time = (*PULSES, (470.0, 473.0, (-0.002, 0.001, 0.001))), np.arange(0.0, 600.0, 2.0)
    com = path_with_burns(time, pulses)
    found = estimate(tracks_of_faces(time, com, (0.3, 1.5, 1.0), 12, seed=3, baseline=0.3), orbit=ORBIT, method="ml")
    assert found.status is Status.GOOD
    assert_found(found, pulses)
    assert found.process_noise.negligible
    assert nees(found, com).mean() < 12


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_a_duration_that_is_hardly_told_is_claimed_so(method):
    """Of 10 mm/s in two seconds the tracks tell where it is, but not well how long it lasts: up to half a minute.

    What the search knew of it was prior to the refinement, that looked at the same tracks again, linearly: begin and
    end were 7 and 10 deviations off, and the centre of mass amid the burn had a χ² of 40 and 55.
    """
    pulse, time = (205.35, 207.64, (0.0084, -0.0018, -0.0045)), np.arange(0.0, 400.0)
    com = path_with_burns(time, (pulse,))
    found = estimate(
        tracks_of_faces(time, com, (-2.0, -1.1, -0.1), 14, seed=0, baseline=3.0), orbit=ORBIT, method=method
    )
    assert_found(found, (pulse,))
    assert nees(found, com).max() < chi2.ppf(1 - 1e-4, 3)


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_two_burns_without_an_orbit(method):
    made = case((LONG, SHORT))
    found = estimate(made.tracks, method=method)
    assert found.status is Status.GOOD
    assert {one.axes for one in burns_in(found)} == {"inertial"}
    assert_found(found, in_C((LONG, SHORT)))
    assert found.process_noise.negligible
    assert nees(found, made.com).mean() < 12
    assert np.sqrt(((found.position - made.com) ** 2).sum(axis=1).mean()) < 0.01


def test_a_kick_without_an_orbit():
    """0.3 m/s in a second, which a smooth path may follow, but so flexibly that it follows the rotation, too."""
    kick = (140.0, 141.0, (0.2, 0.2, -0.1))
    made = case((kick,), seed=6, seen=TIME < 200.0)
    found = estimate(made.tracks)
    assert found.status is Status.GOOD
    assert_found(found, in_C((kick,)))
    assert nees(found, made.com).mean() < 12
    assert found.predicted_rmse < 0.01


def test_a_kick_among_so_many_frames_that_smooth_paths_are_interpolated(monkeypatch):
    """The Jacobian by a kick's times jumps: interpolated, it kept the steps of `ml` from converging."""
    for module in (interpolated_path, jacobians):
        monkeypatch.setattr(module, "FEWEST", 400)
    monkeypatch.setattr(iteration, "Knots", lambda *_: pytest.fail("a path that jumps is looked at between frames"))
    time, kick = np.linspace(0.0, 300.0, 401), (140.0, 141.0, (0.2, 0.2, -0.1))
    com, R = path_with_burns(time, (kick,)), attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), time)
    tracks = make_case(time, R, com, box_features(8, (10, 4, 4), 1), noise=0.02, seed=6).tracks
    found = estimate(tracks, method="ml", orbit=ORBIT)
    assert_found(found, (kick,))
    assert nees(found, com).mean() < 12


def test_a_burn_after_which_no_frame_fits_the_path():
    """0.2 m/s²: without the burn, the frames before it would be outliers of the path after it, a hundred metres off."""
    strong = (62.0, 74.0, (-0.4, -2.2, 1.7))
    made = case((strong,))
    found = estimate(made.tracks, orbit=ORBIT)
    assert found.status is Status.GOOD
    assert_found(found, (strong,))
    assert nees(found, made.com).mean() < 12


@pytest.mark.parametrize("orbit", [ORBIT, None])
def test_no_burn_leads_to_and_from_an_attitude_that_strays(orbit):
    """In two frames the features are turned about their centroid by 0.6 rad, as three are in a wrong pose that fits."""
    made = case((LONG, SHORT))
    position, wrong = made.tracks.position.copy(), [231, 236]
    centre = position[wrong].mean(axis=1, keepdims=True)
    position[wrong] = (position[wrong] - centre) @ Rotation.from_rotvec([0.2, -0.4, 0.4]).as_matrix() + centre
    found = estimate(FeatureTracks(TIME, position, made.tracks.labels), orbit=orbit)
    assert found.status is Status.GOOD
    assert_found(found, (LONG, SHORT) if orbit is not None else in_C((LONG, SHORT)))
    assert nees(found, made.com).mean() < 12


def test_what_is_written_of_a_burn():
    found = found_on_orbit((LONG,))
    (burn,) = burns_in(found)
    (part,) = document_of(found).findings
    assert (part.kind, part.begin, part.change, part.change_deviation) == (
        "unknown-burn",
        burn.begin,
        burn.change,
        burn.change_deviation,
    )
    assert "which nothing told" in part.text
    with pytest.raises(InputError, match="unknown_burns is 'some', expected one of auto, none"):
        PathOptions(unknown_burns="some")


@METHODS
def test_predictions_bridge_a_burn(method):
    """Before the first frame, at those of the tracks, which are the estimate, and ahead."""
    seen = (TIME >= 60) & (TIME <= 440)
    found = estimate(case((LONG, SHORT), seen=seen).tracks, method=method, orbit=ORBIT)
    at = found.predict(TIME[seen][::50])
    np.testing.assert_allclose(at.position, found.position[::50], atol=1e-9)
    np.testing.assert_allclose(at.velocity, found.velocity[::50], atol=1e-11)
    ends = found.predict(TIME[[0, -1]])
    for error, covariance in zip(ends.position - path((LONG, SHORT))[[0, -1]], ends.covariance[:, :3, :3], strict=True):
        assert error @ np.linalg.solve(covariance, error) < 16.3  # of three degrees of freedom, in a thousandth


def test_none_are_looked_for():
    made = case((LONG,))
    found = estimate(made.tracks, orbit=ORBIT, options=PathOptions(unknown_burns="none"))
    assert not any(isinstance(one, UnknownBurn) for one in found.findings)
    assert found.predicted_rmse > 5 * found_on_orbit((LONG,)).predicted_rmse


def test_a_burn_while_nothing_is_seen():
    """What is seen before and after tells the change of velocity and the middle, not the duration."""
    seen = ~((BLACKOUT[0] < TIME) & (BLACKOUT[1] > TIME))
    made = case((LONG,), seen=seen)
    found = estimate(made.tracks, orbit=ORBIT)
    (burn,) = burns_in(found)
    assert_found(found, (LONG,))
    middle = (burn.begin + burn.end) / 2
    assert abs(middle - (LONG[0] + LONG[1]) / 2) < 2.0
    assert burn.end_deviation > 5.0
    assert nees(found, made.com).mean() < 12
    dark = TIME[~seen]
    inside = found.predict(dark)
    error = inside.position - path((LONG,))[~seen]
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(inside.covariance[:, :3, :3]), error)
    assert squares.max() < 25


@pytest.mark.parametrize(("density", "orbit"), [(1e-10, ORBIT), (1e-6, ORBIT), (1e-8, None)])
def test_no_burn_is_found_where_there_is_none(density, orbit):
    """White acceleration of a density in m²/s³, as 25 pushes that last; at 1e-6 the path is off by a metre."""
    rng = np.random.default_rng(8)
    step = 20.0
    pushes = tuple(
        (begin, begin + step, tuple(np.sqrt(density * step) * rng.standard_normal(3)))
        for begin in np.arange(0.0, 500.0, step)
    )
    found = estimate(case(pushes).tracks, orbit=orbit)
    assert not any(isinstance(one, UnknownBurn) for one in found.findings)
    assert found.process_noise.significance > 10


def test_a_passage_of_the_periapsis_is_no_burn():
    """Of an orbit of e = 0.66, which a smooth path does not follow: 60 frames, of which the tenth is next to it. The
    orbit is not given, but found.
    """
    passing, about = drawn(77, 78), slice(30, 90)
    seen = sampled(passing).tracks
    found = estimate(FeatureTracks(seen.time[about], seen.position[about], seen.labels))
    assert not any(isinstance(one, UnknownBurn) for one in found.findings)
    (orbit,) = [one for one in found.findings if isinstance(one, EstimatedOrbit)]
    assert abs(orbit.eccentricity - passing.orbit.eccentricity) < 4.5 * orbit.eccentricity_deviation
    assert found.status is Status.GOOD
    error = found.position - passing.path[about]
    assert np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error).max() < 25


@pytest.mark.parametrize("orbit", [ORBIT, None])
def test_no_burn_is_found_in_free_flight(orbit):
    assert burns_in(estimate(case(()).tracks, orbit=orbit)) == ()


def test_a_search_that_leads_off_finds_none():
    """Case 42 of the population's seed 90, with outliers: it led to a relative orbit millions of kilometres away."""
    made = drawn(90, 42)
    found = estimate(sampled(made).tracks, orbit=made.orbit, options=PathOptions(sigma=1.0))
    assert found.status is Status.GOOD
    assert np.linalg.norm(found.position - made.path, axis=1).max() < 0.05


def test_attitudes_that_only_a_solution_with_a_burn_has_right_are_no_burn():
    """A quarter of the observations displaced, 200 frames: frames whose attitude outliers have spoilt were right in the
    solution with a burn alone, which was likelier for that.
    """
    made, about = drawn(166, 16), slice(0, 200)
    seen = sampled(made).tracks
    tracks = FeatureTracks(seen.time[about], seen.position[about], seen.labels, seen.covariance[about])
    found = estimate(tracks, orbit=made.orbit, options=PathOptions(sigma=made.told))
    assert not any(isinstance(one, UnknownBurn) for one in found.findings)
    error = found.position - made.path[about]
    assert np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error).max() < 25
