"""The drifting pivot: lack of fit, degrees that the data choose, and the noise of a stereo rig."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.findings import FewFrames
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.paths.sampled_path import IsotropicPath
from baryscope.estimator.pivot.method import solve_pivot
from baryscope.estimator.prose import sentence
from baryscope.estimator.result import Status
from baryscope.models.errors import ComputationError
from free_paths import NOISE, TEN, assert_good, at_rest, squared_error_of_cluster
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case, rig_tracks

RATE = np.deg2rad([2.4, 4.4, 4.8])
FEATURES = box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
TIME = np.arange(300.0)
START = np.array([4.0, -19.0, 3.0])


@pytest.fixture(scope="module")
def tumbling():
    return attitude(ENVISAT, RATE, TIME)


def moving(degree):
    """A path in C with a term of about 1 m in each power up to degree."""
    s = TIME[:, None] / 300
    directions = np.random.default_rng(0).normal(size=(degree + 1, 3))
    return START + np.zeros((300, 3)) + sum(s**k * directions[k] for k in range(1, degree + 1))


@pytest.mark.parametrize("degree", [0, 4])
def test_a_smooth_path_needs_no_degree(tumbling, degree):
    """The covariance holds without a degree, and is at most 0.6 larger than for the right one."""
    squares, smooth, known = [], [], []
    for seed in range(2):
        case = make_case(TIME, tumbling, moving(degree), FEATURES, noise=0.02, seed=seed)
        found = estimate(case.tracks, method="pivot")
        right = estimate(
            case.tracks, method="pivot", options=PathOptions(trajectory=f"polynomial:{degree}", process_noise="none")
        )
        error = found.position[150] - case.com[150]
        squares.append(error @ np.linalg.solve(found.covariance[150], error))
        smooth.append(found.predicted_rmse)
        known.append(right.predicted_rmse)
        assert found.findings == ()
    # The mean of two values of χ²₃ is beyond either once in a thousand.
    low, high = chi2.ppf([0.0005, 0.9995], 6) / 2
    assert low < np.mean(squares) < high
    assert np.median(smooth) < 1.6 * np.median(known)


def test_a_smooth_path_of_several_turns_needs_no_degree_either(tumbling):
    """Four turns of a circle of 20 m, as relative motion makes in two orbits: coefficient 20 is 2 cm, 40 is 1e-15 m."""
    angle = 8 * np.pi * TIME / 300
    path = START + 20 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    case = make_case(TIME, tumbling, path, FEATURES, noise=0.02)
    found = estimate(case.tracks, method="pivot")
    error = found.position[150] - case.com[150]
    assert found.status is Status.GOOD
    assert error @ np.linalg.solve(found.covariance[150], error) < chi2.ppf(0.9999, 3)
    assert found.process_noise.density < 1e-12  # nothing is left to noise; with twenty coefficients it is 3e-7 m²/s³


@pytest.mark.parametrize("trajectory, degree", [("fixed", 1), ("fixed", 2), ("polynomial:1", 2)])
def test_a_wrong_path_model_is_reported(tumbling, trajectory, degree):
    case = make_case(TIME, tumbling, moving(degree), FEATURES, noise=0.02)
    found = estimate(case.tracks, method="pivot", options=PathOptions(trajectory=trajectory, process_noise="none"))
    (finding_text,) = [sentence(finding) for finding in found.findings]
    assert trajectory in finding_text
    right = estimate(
        case.tracks, method="pivot", options=PathOptions(trajectory=f"polynomial:{degree}", process_noise="none")
    )
    assert right.findings == ()


THRUST = np.outer(TIME**2 / 2, [2e-5, 0, 4e-5])


def test_thrust_on_a_free_relative_orbit_is_reported_without_process_noise(tumbling):
    orbit = Orbit()
    com = -(orbit.R_I_L(TIME) @ np.array([0.0, -20.0, 0.0])) + THRUST
    case = make_case(TIME, tumbling, com, FEATURES, noise=0.02)
    found = estimate(case.tracks, method="pivot", orbit=orbit.model(), options=PathOptions(process_noise="none"))
    assert any("relative-orbit" in finding_text for finding_text in [sentence(finding) for finding in found.findings])


def test_thrust_on_a_free_relative_orbit_costs_no_more_than_its_process_noise(tumbling):
    """The thrust moves the chaser by 2 m."""
    orbit, squares = Orbit(), []
    com = -(orbit.R_I_L(TIME) @ np.array([0.0, -20.0, 0.0])) + THRUST
    for seed in range(5):
        case = make_case(TIME, tumbling, com, FEATURES, noise=0.02, seed=seed)
        found = estimate(case.tracks, method="pivot", orbit=orbit.model())
        error = found.position[[20, 150, 280]] - case.com[[20, 150, 280]]
        squares += [e @ np.linalg.solve(P, e) for e, P in zip(error, found.covariance[[20, 150, 280]], strict=True)]
        assert np.linalg.norm(error, axis=1).max() < 0.01
    # A constant thrust is no white noise: the covariance may be too large, not too small by more than chance.
    assert np.mean(squares) < 3 + 4 * np.sqrt(6 / 15)


def test_a_path_bends_as_it_is_seen_though_its_place_along_a_spins_axis_is_not_told():
    """Pushed at random: with no more modes than the variance of its places asks for, errors broke their claims."""
    time = np.arange(200.0)
    spin = Rotation.from_rotvec(np.outer(0.2 * time, [0.3, 0.9, 0.3])).as_matrix()
    pushes = 2e-3 * np.random.default_rng(1).standard_normal((200, 3)) * (np.arange(200) % 5 == 0)[:, None]
    case = make_case(time, spin, START + np.cumsum(np.cumsum(pushes, axis=0), axis=0), FEATURES, noise=1e-3)
    found = estimate(case.tracks, options=PathOptions(trajectory="polynomial"))
    assert found.noise.a_posteriori == pytest.approx(1e-3, rel=0.05)
    error = found.position - case.com
    squares = np.einsum("ni,ni->n", error, np.linalg.solve(found.covariance, error[..., None])[..., 0])
    assert np.median(squares) < 5
    assert squares.max() < chi2.isf(1e-6, 3)


def test_no_finding_for_the_right_path_model(tumbling):
    """Twenty draws, each with a probability of a false finding of 1e-7."""
    for seed in range(20):
        case = make_case(TIME, tumbling, moving(0), FEATURES, noise=0.02, seed=seed)
        found = estimate(case.tracks, method="pivot", options=PathOptions(trajectory="fixed"))
        assert found.findings == ()


def test_stereo_range_is_unbiased_and_its_error_is_as_predicted(tumbling):
    """At 20 m the depth has a deviation of 0.15 m, the mean of 2,400 one of 3 mm; the uncorrected bias is larger."""
    com = np.tile(START, (300, 1))
    sight = START / np.linalg.norm(START)
    draws = {"stereo": 16, "fixed": 6}
    errors, squares = {"stereo": [], "fixed": []}, []
    for noise, count in draws.items():
        for seed in range(count):
            tracks = rig_tracks(TIME, tumbling, com, FEATURES, seed=seed)
            found = estimate(tracks, method="pivot", options=PathOptions(trajectory="fixed", noise=noise))
            error, covariance = found.position[0] - com[0], found.covariance[0]
            errors[noise].append(sight @ error / np.sqrt(sight @ covariance @ sight))
            if noise == "stereo":
                squares.append(error @ np.linalg.solve(covariance, error))
                assert found.noise.a_posteriori**2 == pytest.approx(1, abs=0.1)
    # The mean of 16 has a standard deviation of 1/4, that of 16 values of χ²₃ one of √(6/16): four of them.
    assert abs(np.mean(errors["stereo"])) < 1.0
    assert np.mean(squares) == pytest.approx(3, abs=4 * np.sqrt(6 / 16))
    # Without the correction the CoM is too near by 1.7 standard deviations.
    assert np.mean(errors["fixed"]) < -0.73


def test_few_frames_for_many_unknowns_are_refused(tumbling):
    """Six frames have 18 values for 21 coefficients and an offset."""
    rows = np.arange(0, 300, 50)
    case = make_case(TIME[rows], tumbling[rows], np.tile(START, (6, 1)), FEATURES, noise=0.02)
    with pytest.raises(ComputationError, match="6 frames show an attitude, too few for polynomial:6: more than 8"):
        estimate(case.tracks, method="pivot", options=PathOptions(trajectory="polynomial:6"))


@pytest.mark.parametrize(("count", "checked"), [(5, False), (12, True)])
def test_fewer_frames_than_unknowns_check_nothing(tumbling, count, checked):
    """A fixed point and an offset are six unknowns; residuals of five frames show no outlier."""
    rows = np.arange(0, 300, 20)[:count]
    case = make_case(TIME[rows], tumbling[rows], np.tile(START, (count, 1)), FEATURES, noise=0.02)
    found = estimate(case.tracks, method="pivot", options=PathOptions(trajectory="fixed", process_noise="none"))
    few = [one for one in found.findings if isinstance(one, FewFrames)]
    assert [(one.frames, one.unknowns) for one in few] == ([] if checked else [(5, pytest.approx(6.0))])
    assert found.status is (Status.GOOD if checked else Status.NOT_CHECKED)


@pytest.mark.parametrize(("frames", "checked"), [(150, False), (15, True)])
def test_frames_with_the_same_errors_count_as_one(tumbling, frames, checked):
    """Of 300 frames two have errors of their own, or twenty, for the same six unknowns."""
    case = make_case(TIME[:300], tumbling[:300], np.tile(START, (300, 1)), FEATURES)
    errors = np.random.default_rng(2).normal(scale=0.02, size=(300 // frames, *case.tracks.position.shape[1:]))
    tracks = replace(case.tracks, position=case.tracks.position + np.repeat(errors, frames, axis=0))
    found = estimate(tracks, method="pivot", options=PathOptions(trajectory="fixed", process_noise="none"))
    few = [one.lasting for one in found.findings if isinstance(one, FewFrames)]
    assert few == ([] if checked else [found.noise.lasting])
    assert found.noise.lasting > 5


def test_a_solution_as_uncertain_as_nothing_can_be_has_diverged(monkeypatch, tumbling):
    case = make_case(TIME[:30], tumbling[:30], np.tile(START, (30, 1)), FEATURES, noise=0.02)
    assert estimate(case.tracks, method="pivot").predicted_rmse > 1e-4
    monkeypatch.setattr("baryscope.estimator.pivot.answer.MAX_LENGTH", 1e-4)
    with pytest.raises(ComputationError, match="diverge"):
        estimate(case.tracks, method="pivot")


def test_a_covariance_is_definite_whatever_it_claims(monkeypatch, tumbling):
    """Tenths of a millimetre across and a hundred kilometres along cannot stand in one matrix of double precision."""
    case = make_case(TIME[:30], tumbling[:30], np.tile(START, (30, 1)), FEATURES, noise=0.02)
    along = np.array([1.0, 1.0, 0.5])
    thin = 1e10 * np.outer(along, along) + 1e-8 * np.eye(3)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(thin)
    monkeypatch.setattr(IsotropicPath, "covariance", lambda path, of_x: np.tile(thin, (30, 1, 1)))
    found = estimate(case.tracks, method="pivot").covariance
    assert (np.linalg.eigvalsh(found) > 0).all()
    np.testing.assert_allclose(found, np.tile(thin, (30, 1, 1)), rtol=1e-13)


@pytest.mark.parametrize(("frames", "checked"), [(3, False), (6, True)])
def test_half_as_many_frames_check_a_smooth_path(frames, checked):
    """Place, velocity and offset are nine unknowns, of which a smooth path has some from its law."""
    time = np.arange(float(frames))
    spin = Rotation.from_rotvec(np.outer(0.5 * time, [0.6, 0, 0.8])).as_matrix()
    found = estimate(make_case(time, spin, at_rest(time), TEN, noise=0.02).tracks, method="pivot")
    few = [one for one in found.findings if isinstance(one, FewFrames)]
    assert [one.frames for one in few] == ([] if checked else [frames])


@pytest.mark.parametrize(("frames", "checked"), [(12, False), (24, True)])
def test_half_as_many_frames_check_process_noise_if_they_tell_it(frames, checked):
    """White acceleration of 1e-8 m²/s³ moves the path by millimetres from frame to frame: nearly two unknowns each."""
    time = 10.0 * np.arange(frames)
    pushes = np.sqrt(1e-8 * 0.1) * np.random.default_rng(5).standard_normal((100 * frames, 3))  # m/s, each 0.1 s
    drift = 0.1 * np.cumsum(np.cumsum(pushes, axis=0), axis=0)[::100]
    com = RelativeOrbit(Orbit().model(), float(time[-1] / 2)).at(time).position(np.r_[START, 0.0, -10.0, 4.0]) + drift
    case = make_case(time, attitude(ENVISAT, RATE, time), com, TEN, noise=0.005)
    found = estimate(case.tracks, orbit=Orbit().model())
    few = [one for one in found.findings if isinstance(one, FewFrames)]
    assert [(one.frames, one.unknowns > frames) for one in few] == ([] if checked else [(frames, True)])
    assert found.status is (Status.GOOD if checked else Status.NOT_CHECKED)
    assert np.linalg.norm(found.position - com, axis=1).max() < 5 * found.predicted_rmse


def test_unknowns_that_only_a_prior_holds_are_not_counted():
    """A body at rest: of the path, its place is told, and that it is hardly inclined: nothing of 93 other unknowns."""
    spin = Rotation.from_rotvec(np.outer(0.06 * np.arange(100), [0.6, 0, 0.8])).as_matrix()
    case = make_case(np.arange(100.0), spin, at_rest(np.arange(100.0)), TEN, noise=0.02)
    assert 3 < solve_pivot(case.tracks, None, PathOptions()).path_unknowns < 6


@pytest.mark.parametrize("trajectory", ["fixed", "polynomial"])
def test_a_body_seen_in_few_of_many_frames_is_kept(trajectory):
    """Its frames remain in the subsample for the initial solution and the degree."""
    time = np.arange(8000.0)
    spin, roll = (Rotation.from_rotvec(np.outer(0.05 * time, axis)) for axis in ([1.0, 0, 0], [0, 0.6, 0.8]))
    clusters = [(0.0, 3600.0, [0, 1, 2, 3]), (3601.0, 3617.0, [4, 5, 6, 7]), (3618.0, 8000.0, [8, 9, 0, 1])]
    case = make_case(time, (spin * roll).as_matrix(), at_rest(time), TEN, noise=NOISE, clusters=clusters)
    found = estimate(case.tracks, options=PathOptions(trajectory=trajectory))
    assert sorted(len(cluster.frames) for cluster in found.clusters) == [16, 3600, 4382]
    assert_good(found, case)
    assert squared_error_of_cluster(found, case, 2) < 4.5**2
