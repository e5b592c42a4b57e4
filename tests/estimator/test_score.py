"""SCoRE: the fixed centre of rotation against a closed form and scipy's least squares."""

import numpy as np
import pytest
from scipy.linalg import lstsq
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.findings import FewFrames, LackOfFit
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, find_bodies
from baryscope.estimator.result import Status
from baryscope.estimator.score import solve_score
from baryscope.models.errors import ComputationError, InputError
from synthetic import ENVISAT, attitude, box_features, make_case

CENTRE = np.array([4.0, -19.0, 3.0])


def normalised(found):
    error = found.position[0] - CENTRE
    return float(error @ np.linalg.solve(found.covariance[0], error))


def test_exact_without_noise_through_clusters_and_blackouts(case_of, at_rest):
    found = estimate(case_of(at_rest).tracks, method="score")
    np.testing.assert_allclose(found.position, at_rest, atol=1e-9)
    assert found.method == "score"
    assert found.path == "fixed"


def test_the_closed_form_for_attitudes_of_zero_sum():
    """The twelve rotations of a tetrahedron: Σ R = 0, so v is the mean of c, and u that of −Rᵀ c."""
    R = Rotation.create_group("T").as_matrix()
    assert np.abs(R.sum(axis=0)).max() < 1e-12
    c = np.random.default_rng(1).normal(size=(12, 3))
    body = Body(np.arange(3), np.arange(12), np.eye(3), R)
    fit = solve_score(Registered((body,), (c,), 0.0))
    np.testing.assert_allclose(fit.centre, c.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(fit.offsets[0], np.einsum("kij,ki->j", R, c) / 12, atol=1e-12)
    np.testing.assert_allclose(fit.inverse, np.eye(6) / 12, atol=1e-12)
    assert fit.variance == pytest.approx(np.sum((c - fit.centre - R @ fit.offsets[0]) ** 2) / 30)


def test_against_scipy_for_several_bodies(case_of, at_rest):
    clusters = [(0.0, 500.0, [0, 1, 2]), (600.0, 1500.0, [3, 4, 5, 6]), (1600.0, 2000.0, [4, 6, 7])]
    tracks = case_of(at_rest, noise=0.02, seed=3, clusters=clusters).tracks
    registered = find_bodies(tracks.position, tracks.seen)
    assert len(registered.bodies) == 3
    rows, rhs = [], []
    for index, (body, origin) in enumerate(zip(registered.bodies, registered.origins, strict=True)):
        row = np.zeros((len(origin), 3, 12))
        row[:, :, 3 * index : 3 * index + 3] = body.attitude
        row[:, :, -3:] = np.eye(3)
        rows.append(row.reshape(-1, 12))
        rhs.append(origin.ravel())
    A, b = np.concatenate(rows), np.concatenate(rhs)
    expected = lstsq(A, b)[0]
    fit = solve_score(registered)
    np.testing.assert_allclose(np.concatenate([fit.offsets.ravel(), fit.centre]), expected, atol=1e-9)
    np.testing.assert_allclose(fit.inverse, np.linalg.inv(A.T @ A), rtol=1e-6, atol=1e-12)
    assert fit.variance == pytest.approx(np.sum((A @ expected - b) ** 2) / (len(b) - 12))
    found = estimate(tracks, method="score")
    np.testing.assert_allclose(found.position[7], expected[-3:], atol=1e-9)
    assert len(found.clusters) == 3


def test_the_error_agrees_with_the_covariance(case_of, at_rest):
    squares = [normalised(estimate(case_of(at_rest, noise=0.02, seed=s).tracks, method="score")) for s in range(8)]
    # The mean of eight χ² of three degrees of freedom has the deviation √(6/8).
    assert np.mean(squares) < 3 + 4 * np.sqrt(6 / 8)


def test_a_moving_centre_is_found_and_widens_the_covariance(case_of, on_v_bar):
    case = case_of(on_v_bar, noise=0.02)
    found = estimate(case.tracks, method="score")
    error = np.linalg.norm(found.position - case.com, axis=1)
    assert found.predicted_rmse > 0.3 * error.max()
    assert found.status is Status.MODEL_DOES_NOT_FIT
    (finding,) = found.findings
    assert isinstance(finding, LackOfFit)
    assert 0.3 * error.max() < finding.magnitude < error.max()


def test_a_centre_that_moves_by_little_more_than_noise_is_found(case_of, at_rest, time):
    """A thousandth of its distance, in thousands of frames."""
    drift = 0.03 * np.linspace(-1, 1, len(time))[:, None] * np.array([0.6, -0.8, 0.0])
    (finding,) = estimate(case_of(at_rest + drift, noise=0.02).tracks, method="score").findings
    assert isinstance(finding, LackOfFit)
    assert finding.magnitude == pytest.approx(0.03 / np.sqrt(3), rel=0.2)


def test_a_motion_that_residuals_do_not_show_is_allowed_for_unless_the_centre_is_said_to_be_at_rest():
    """A centimetre either way in 60 frames of a turn or so, with noise of two: found in few draws, and not claimed."""
    some = np.arange(60.0)
    turn, precession = 1.2 * 2 * np.pi * some[:, None] / 60, 0.4 * 1.2 * 2 * np.pi * some[:, None] / 60
    R = (Rotation.from_rotvec(precession * [0.3, 0.9, 0.1]) * Rotation.from_rotvec(turn * [0.0, 0.6, 0.8])).as_matrix()
    moving, at_rest = [], []
    for seed in range(20):
        way = np.random.default_rng(seed).normal(size=3)
        for drift, trajectory, squares in ((0.01, None, moving), (0.0, "fixed", at_rest)):
            com = CENTRE + drift * np.linspace(-1, 1, 60)[:, None] * way / np.linalg.norm(way)
            tracks = make_case(some, R, com, box_features(8, (3, 2, 1), 1), noise=0.02, seed=seed).tracks
            found = estimate(tracks, method="score", options=PathOptions(trajectory=trajectory))
            error = found.position[0] - com[0]
            if found.status is Status.GOOD:
                squares.append(error @ np.linalg.solve(found.covariance[0], error))
    assert len(moving) > 10
    assert max(moving) < 16.3  # of χ² with three degrees of freedom, 1e-3
    # The mean of twenty χ² of three degrees of freedom has the deviation √(6/20).
    assert np.mean(at_rest) == pytest.approx(3, abs=4 * np.sqrt(6 / 20))


@pytest.mark.parametrize(("frames", "checked"), [(8, False), (9, True)])
def test_in_too_few_frames_nothing_tells_whether_the_centre_moves(frames, checked):
    """A motion of fifteen unknowns is looked for, beside an offset: half as many frames are needed."""
    some = 30.0 * np.arange(frames)
    turning = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), some)
    case = make_case(some, turning, np.tile(CENTRE, (frames, 1)), box_features(8, (3, 2, 1), 1), noise=0.02)
    found = estimate(case.tracks, method="score")
    assert found.findings == (() if checked else (FewFrames(frames, 18.0),))
    assert found.status.trustworthy == checked


def test_a_pure_spin_is_not_observable(time):
    """The noise of the attitudes pretends to information along the axis."""
    axis = np.linalg.eigh(ENVISAT)[1][:, 2]
    some = time[:600:2]
    R_I_B, points = (
        attitude(ENVISAT, np.deg2rad(3.5) * axis, some),
        box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0)),
    )
    for noise in (0.02, 0.1):
        tracks = make_case(some, R_I_B, np.tile(CENTRE, (len(some), 1)), points, noise=noise).tracks
        found = estimate(tracks, method="score")
        assert found.status is Status.NOT_OBSERVABLE
        assert normalised(found) < 16.3  # of χ² with three degrees of freedom, 1e-3


@pytest.mark.parametrize("turn", [0.0, 0.02, 0.2])
def test_a_covariance_is_definite_that_is_metres_along_an_axis_and_nothing_across(time, turn):
    """Tracks without noise of a body that spins or is still: an eigenvalue of the covariance was −1e-14 m²."""
    some, axes = time[:60], np.random.default_rng(1).normal(size=(20, 3))
    for axis in axes / np.linalg.norm(axes, axis=1, keepdims=True):
        R = Rotation.from_rotvec(turn * some[:, None] * axis).as_matrix()
        tracks = make_case(some, R, np.tile(CENTRE, (60, 1)), box_features(4, (2, 2, 2), seed=1)).tracks
        assert np.linalg.eigvalsh(estimate(tracks, method="score").covariance)[:, 0].min() > 0


def test_errors_name_what_is_wrong(case_of, at_rest, orbit):
    tracks = case_of(at_rest).tracks
    with pytest.raises(InputError, match="trajectory is 'relative-orbit', expected fixed"):
        estimate(tracks, method="score", orbit=orbit.model(), options=PathOptions(trajectory="relative-orbit"))
    estimate(tracks, method="score", orbit=orbit.model(), options=PathOptions(trajectory="fixed"))
    with pytest.raises(ComputationError, match="at most 2 features"):
        estimate(case_of(at_rest, clusters=[(0.0, 900.0, [0, 1])]).tracks, method="score")


def test_at_rest_in_the_orbit(case_of, on_v_bar, orbit):
    """In a V-bar hold the centre moves by metres in C, and is at rest in LVLH, the ground if an orbit is given."""
    tracks = case_of(on_v_bar, noise=0.02).tracks
    found = estimate(tracks, method="score", orbit=orbit.model())
    error = np.linalg.norm(found.position - on_v_bar, axis=1)
    deviation = np.sqrt(np.trace(found.covariance, axis1=1, axis2=2))
    assert np.all(error < 4 * deviation)
    assert error.max() < 0.01
    assert found.path == "fixed in LVLH"
    np.testing.assert_allclose(  # a central difference of the path itself, off by n³ r h²/6 = 4e-9 m/s
        found.velocity[1:-1],
        (found.position[2:] - found.position[:-2]) / (2 * (found.time[1] - found.time[0])),
        atol=1e-8,
    )
    in_C = estimate(tracks, method="score", orbit=orbit.model(), options=PathOptions(trajectory="fixed"))
    assert np.abs(in_C.velocity).max() == 0
    assert np.linalg.norm(in_C.position - on_v_bar, axis=1).max() > 1


@pytest.mark.parametrize("method", ["pivot", "ml", "score"])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_body_at_rest_tells_nothing_of_its_centre(method, noise):
    """Not even without noise: the error is within a deviation of metres, and no number overflows."""
    time = np.arange(40.0)
    com = np.tile([4.0, -19.0, 3.0], (40, 1))
    points = box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
    case = make_case(time, np.tile(np.eye(3), (40, 1, 1)), com, points, noise=noise, seed=1)
    found = estimate(case.tracks, method=method, options=PathOptions(trajectory="fixed"))
    assert found.status is Status.NOT_OBSERVABLE
    error = found.position[0] - com[0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 4.5**2
    assert 1.0 < found.predicted_rmse < 100.0


def test_noisy_attitudes_leave_the_centre_too_near_the_features():
    """Along the axis of a spin that hardly nutates, by a fiftieth of 0.4 m: claimed are these 8 mm, not 2."""
    time = np.arange(400.0)
    nutation = Rotation.from_rotvec(0.1 * np.column_stack([np.sin(0.31 * time), np.cos(0.23 * time), 0 * time]))
    R = (nutation * Rotation.from_rotvec(np.outer(0.2 * time, [0.0, 0.0, 1.0]))).as_matrix()
    features = box_features(6, (0.2, 0.2, 0.2), 1, centre=(0.0, 0.0, 0.4))
    still = np.tile(CENTRE, (len(time), 1))
    errors, squares = [], []
    for seed in range(8):
        found = estimate(make_case(time, R, still, features, noise=0.002, seed=seed).tracks, method="score")
        errors.append(found.position[0] - CENTRE)
        squares.append(normalised(found))
    assert np.mean(errors, axis=0)[2] > 0.005
    assert max(squares) < chi2.isf(1e-4, 3)
