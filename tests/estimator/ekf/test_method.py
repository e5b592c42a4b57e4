"""The iterated extended Kalman filter on tracks that are simulated without any of its models."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.dynamics.rotation import INERTIA_BASIS
from baryscope.estimator.dynamics.rotation import Rotation as Tumbling
from baryscope.estimator.ekf.filter import Trace
from baryscope.estimator.ekf.method import estimate_by_filter
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, derivatives, rotated, white_noise
from baryscope.estimator.ekf.restart import restarted
from baryscope.estimator.ekf.smoother import smoothed_path
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.methods import estimate
from baryscope.estimator.ml.method import estimate_by_likelihood
from baryscope.estimator.options import PathOptions
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case

FAST, SLOW = (3.38, 0.45, 0.77), (1.0, 0.3, 0.5)  # °/s
CIRCULAR = Orbit(eccentricity=0.0)  # on which a hold on V-bar is free motion
CLUSTERS = [
    (0.0, 150.0, [0, 1, 2, 3]),
    (140.0, 330.0, [2, 3, 4, 5]),
    (360.0, 480.0, [0, 3, 5]),
    (482.0, 600.0, [0, 1, 2]),
]


@pytest.fixture(scope="module")
def sampled():
    """600 s, every 3 s."""
    return np.arange(0.0, 600.0, 3.0)


@pytest.fixture(scope="module")
def tracked(sampled):
    """Tracks of six features of Envisat from 20 m on V-bar, at rates in °/s."""
    turned = {rates: attitude(ENVISAT, np.deg2rad(rates), sampled) for rates in (FAST, SLOW)}
    points = box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0))

    def make(rates=FAST, *, seed=0, noise=0.02, clusters=None, members=slice(None), on=CIRCULAR):
        com = -(on.R_I_L(sampled) @ np.array([0.0, -20.0, 0.0]))
        return make_case(sampled, turned[rates], com, points[members], noise=noise, seed=seed, clusters=clusters)

    return make


def with_positions(tracks, position, covariance=None):
    return FeatureTracks(tracks.time, position, tracks.labels, covariance)


def run(case, orbit=CIRCULAR, **options):
    return estimate_by_filter(case.tracks, orbit.model() if orbit else None, PathOptions(**options))


def rms(found, case):
    return float(np.sqrt(np.mean(np.sum((found.position - case.com) ** 2, axis=1))))


def normalised(found, case):
    """Mean squared error over time in units of the covariance; 3 is expected."""
    error = found.position - case.com
    return float(np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)))


@pytest.mark.parametrize("rates", [FAST, SLOW])
def test_agrees_with_the_estimate_of_ml(tracked, rates):
    """Measured over 20 seeds at 1 Hz and 8 features: the same rms error as `ml` to 1 %."""
    squares = []
    for seed in range(2):
        case = tracked(rates, seed=seed)
        found = run(case)
        best = estimate_by_likelihood(case.tracks, CIRCULAR.model(), PathOptions(torque="none"))
        deviation = best.predicted_rmse
        assert np.sqrt(np.mean(np.sum((found.position - best.position) ** 2, axis=1))) < 0.25 * deviation
        assert found.predicted_rmse == pytest.approx(deviation, rel=0.05)
        assert found.converged
        chosen = found.details
        assert (chosen.order, chosen.path_noise, chosen.turn_noise, chosen.gravity_gradient) == (1, 0.0, 0.0, False)
        assert chosen.nis == pytest.approx(1.0, abs=0.08)
        assert found.noise.a_posteriori == pytest.approx(0.02, rel=0.05)
        moments = np.linalg.eigvalsh(chosen.inertia)
        np.testing.assert_allclose(moments, np.linalg.eigvalsh(ENVISAT / np.trace(ENVISAT)), atol=0.005)
        squares.append(normalised(found, case))
    assert np.mean(squares) < 3 * 3


def test_features_that_come_and_go(tracked):
    case = tracked(clusters=CLUSTERS, seed=4)
    found = run(case)
    assert found.converged
    assert normalised(found, case) < 5 * 3
    assert found.coverage < 1


def test_a_lost_attitude_is_recovered_after_gaps(tracked):
    """The first passes lose the attitude in gaps of 180 s; the last one predicts it."""
    case = tracked(clusters=[(start, start + 36.0, range(6)) for start in (0.0, 216.0, 432.0, 564.0)], seed=2)
    found = run(case)
    best = estimate_by_likelihood(case.tracks, CIRCULAR.model(), PathOptions(torque="none"))
    assert found.converged
    assert found.details.restarts == 0
    assert rms(found, case) < 1.2 * rms(best, case)
    assert found.predicted_rmse == pytest.approx(best.predicted_rmse, rel=0.1)


def test_long_tracks_choose_the_noise_from_their_first_frames(tracked):
    """600 frames, of which the first 200 choose the noise, with a gap of 150 s, against `ml`."""
    time = np.arange(0.0, 750.0)
    com = -(CIRCULAR.R_I_L(time) @ np.array([0.0, -20.0, 0.0]))
    clusters = [(0.0, 300.0, range(4)), (450.0, 750.0, range(1, 6))]
    points = box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
    turned = attitude(ENVISAT, np.deg2rad(FAST), time)
    case = make_case(time, turned, com, points, noise=0.02, seed=0, clusters=clusters)
    found = run(case)
    best = estimate_by_likelihood(case.tracks, CIRCULAR.model(), PathOptions())
    assert found.converged
    assert rms(found, case) < 1.2 * rms(best, case)
    assert found.predicted_rmse == pytest.approx(best.predicted_rmse, rel=0.1)


def test_outliers_are_gated(tracked):
    case = tracked(seed=1)
    rng = np.random.default_rng(7)
    position = case.tracks.position.copy()
    hit = rng.random(position.shape[:2]) < 0.05
    position[hit] += rng.normal(size=(int(hit.sum()), 3))
    found = estimate_by_filter(with_positions(case.tracks, position), CIRCULAR.model(), PathOptions())
    assert normalised(found, case) < 5 * 3
    assert found.rejected_share == pytest.approx(hit.mean(), abs=0.005)
    assert found.noise.a_posteriori == pytest.approx(0.02, rel=0.05)


def test_a_feature_that_jumps_is_initialised_again(tracked):
    case = tracked(seed=2)
    position = case.tracks.position.copy()
    position[100:, 2] += np.einsum("nij,j->ni", case.R_I_B[100:], [2.0, -1.0, 1.0])
    found = estimate_by_filter(with_positions(case.tracks, position), CIRCULAR.model(), PathOptions())
    assert normalised(found, case) < 5 * 3


def test_an_unknown_path_has_its_noise_chosen_and_is_smoothed(tracked):
    case = tracked(seed=3)
    found = run(case, orbit=None)
    chosen = found.details
    assert chosen.path_noise > 0
    assert found.converged
    assert found.path == f"polynomial:{chosen.order}"
    assert normalised(found, case) < 3 * 3
    # The filter's standard deviation at the end exceeds that of the smoothed path in the middle.
    assert np.sqrt(np.trace(found.details.final_covariance)) > np.sqrt(np.trace(found.covariance[100]))


def test_a_path_with_thrust_gets_process_noise(tracked):
    """On an ellipse a hold on V-bar needs thrust: 1e-6 m/s² that the filter does not know."""
    elliptic = Orbit(eccentricity=0.01)
    case = tracked(seed=5, on=elliptic)
    found = run(case, orbit=elliptic)
    assert found.details.path_noise > 0
    assert normalised(found, case) < 5 * 3


def test_a_thrust_that_the_first_frames_do_not_show():
    """The hold on an ellipse: free motion fits the first 200 of 600 frames, but not all of them."""
    elliptic, time = Orbit(eccentricity=0.003), np.arange(0.0, 1800.0, 3.0)
    com = -(elliptic.R_I_L(time) @ np.array([0.0, -20.0, 0.0]))
    points = box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0))
    case = make_case(time, attitude(ENVISAT, np.deg2rad(FAST), time), com, points, noise=0.02, seed=0)
    found = run(case, orbit=elliptic)
    assert found.details.path_noise > 0
    assert found.converged
    assert normalised(found, case) < 5 * 3


def test_the_gravity_gradient_is_distinguished_from_none():
    time = np.arange(0.0, 1500.0, 5.0)
    R_I_B = Tumbling(0.0, np.eye(3), np.deg2rad(SLOW), ENVISAT, CIRCULAR.model()).at(time).attitude
    com = -(CIRCULAR.R_I_L(time) @ np.array([0.0, -20.0, 0.0]))
    case = make_case(time, R_I_B, com, box_features(6, (10, 5, 5), seed=3), noise=0.02, seed=0)
    found = run(case)
    assert found.details.gravity_gradient
    assert found.options.torque == "gravity-gradient"
    assert normalised(found, case) < 5 * 3


def test_a_fixed_centre_and_known_noise(tracked, sampled):
    case = tracked(seed=6)
    still = case.tracks.position - case.com[:, None] + np.array([4.0, -19.0, 3.0])
    tracks = with_positions(case.tracks, still, np.tile(1e-4 * np.eye(3), (*case.tracks.seen.shape, 1, 1)))
    found = estimate_by_filter(tracks, None, PathOptions(trajectory="fixed", sigma=2.0))
    assert found.noise.a_priori == 2.0
    assert found.noise.a_posteriori == pytest.approx(2.0, rel=0.05)
    error = found.position - [4.0, -19.0, 3.0]
    assert np.ptp(found.position, axis=0).max() < 1e-9
    assert error[0] @ np.linalg.solve(found.covariance[0], error[0]) < 16  # of χ² with three degrees of freedom, 1e-3
    guessed = estimate_by_filter(tracks, None, PathOptions(trajectory="fixed"))
    assert guessed.noise.a_posteriori**2 == pytest.approx(4.0, rel=0.1)


def test_insufficient_first_frames_are_refused_in_one_sentence(tracked):
    with pytest.raises(ComputationError, match="at most 2 features"):
        run(tracked(members=slice(2)))
    tracks = tracked().tracks
    short = FeatureTracks(tracks.time[:3], tracks.position[:3], tracks.labels)
    with pytest.raises(ComputationError, match="3 frames, 4 are needed for a rate"):
        estimate(short, method="ekf")
    with pytest.raises(InputError, match="gravity-gradient, which needs the target's orbit"):
        estimate(tracks, method="ekf", options=PathOptions(torque="gravity-gradient"))
    with pytest.raises(InputError, match="expected fixed, polynomial"):
        estimate(tracks, method="ekf", options=PathOptions(trajectory="parabola"))


def test_rotation_against_an_independent_integration():
    rate = np.deg2rad(FAST)
    truth = attitude(ENVISAT, rate, np.array([0.0, 10.0]))[1]
    q, _, _ = rotated(np.array([[1.0, 0, 0, 0]]), rate[None], ENVISAT[None] / 1e5, np.zeros((1, 3)), 10.0)
    missed = Rotation.from_quat(np.roll(q[0], -1)).inv() * Rotation.from_matrix(truth)
    assert missed.magnitude() < 1e-6


def test_transition_of_rotation_errors_against_differences():
    rate, J, h = np.deg2rad(FAST), ENVISAT / np.trace(ENVISAT), 4.0
    root = np.linalg.cholesky(J)

    def after(error):
        half = Rotation.from_rotvec(error[:3])
        values, vectors = np.linalg.eigh(np.tensordot(error[6:], INERTIA_BASIS, 1))
        inertia = root @ vectors @ np.diag(np.exp(values)) @ vectors.T @ root.T
        q, w, _ = rotated(
            np.roll(half.as_quat(), 1)[None], (rate + error[3:6])[None], inertia[None], np.zeros((1, 3)), h
        )
        return Rotation.from_quat(np.roll(q[0], -1)), w[0]

    _, _, growth = rotated(np.array([[1.0, 0, 0, 0]]), rate[None], J[None], np.zeros((1, 3)), h)
    for index in range(ROTATION):
        step = np.zeros(ROTATION)
        step[index] = 1e-5
        (R1, w1), (R0, w0) = after(step), after(-step)
        difference = np.concatenate([(R0.inv() * R1).as_rotvec(), w1 - w0, step[6:] * 2]) / 2e-5
        np.testing.assert_allclose(growth[0][:, index], difference, atol=2e-3 * np.abs(difference).max())


def test_a_restart_finds_the_attitude_of_a_known_body():
    rng = np.random.default_rng(0)
    truth = Rotation.from_rotvec([2.0, -1.0, 0.5])
    points = rng.normal(size=(2, 4, 3))  # the second member knows another body
    seen = truth.apply(points[0]) + np.array([4.0, -19.0, 3.0])
    s = 6 + ROTATION + 12
    upright = np.tile([1.0, 0, 0, 0], (2, 1))
    state = State(
        np.zeros((2, 6)), upright, np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), points, np.zeros((2, s, s))
    )
    measured = Measured(seen[None], np.tile(1e-4 * np.eye(3), (1, 4, 1, 1)), np.ones((1, 4), dtype=bool))
    told = np.ones((2, 4), dtype=bool)
    again, found, pick = restarted(state, 0, np.arange(4), measured, told, np.array([True, True]), 0.1)
    assert found.tolist() == [True, False]
    missed = Rotation.from_quat(np.roll(again.quaternion[0], -1)).inv() * truth
    assert missed.magnitude() < 1e-9
    np.testing.assert_allclose(np.diag(again.covariance[0])[6:12], [1.0] * 3 + [0.01] * 3)
    assert np.array_equal(np.diag(pick), np.repeat([1.0, 0.0, 1.0], [6, 6, s - 12]))
    np.testing.assert_array_equal(again.quaternion[1], upright[1])
    assert not restarted(state, 0, np.arange(2), measured, told[:, :2], np.array([True, True]), 0.1)[1].any()


def test_corrections_of_attitude_and_inertia():
    """Against scipy's rotations and an eigenvalue decomposition."""
    turn, change = np.array([0.3, -0.2, 0.4]), np.array([0.2, -0.1, 0.05, 0.3, -0.2])
    before = Rotation.from_rotvec([0.5, 1.0, -2.0])
    inertia = ENVISAT / np.trace(ENVISAT)
    q = np.roll(before.as_quat(), 1)
    state = State(
        np.zeros((1, 3)), q[None], np.zeros((1, 3)), inertia[None], np.zeros((1, 0, 3)), np.zeros((1, 14, 14))
    )
    after = state.changed(np.concatenate([np.zeros(3), turn, np.zeros(3), change])[None], state.covariance)
    missed = Rotation.from_quat(np.roll(after.quaternion[0], -1)).inv() * before * Rotation.from_rotvec(turn)
    assert missed.magnitude() < 1e-12
    values, vectors = np.linalg.eigh(np.tensordot(change, INERTIA_BASIS, 1))
    root = np.linalg.cholesky(inertia)
    expected = root @ vectors @ np.diag(np.exp(values)) @ vectors.T @ root.T
    np.testing.assert_allclose(after.inertia[0], expected, atol=1e-7)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_unit_noise_gives_one_metre_after_the_time_span(order):
    time = np.array([0.0, 3.0, 4.0, 9.0, 15.0])
    process, noise = derivatives(order + 1, time, np.zeros(3)), white_noise(order, order + 1, time)
    covariance = np.zeros_like(noise[0])
    for transition, added in zip(process.transition, noise, strict=True):
        covariance = transition @ covariance @ transition.T + added
    np.testing.assert_allclose(covariance[:3, :3], np.eye(3), atol=1e-12)


def test_the_smoother_against_dense_least_squares():
    """A directly observed path: a textbook filter, and as oracle one linear system of all frames."""
    rng = np.random.default_rng(0)
    time = np.array([0.0, 1.0, 2.5, 3.0, 5.0, 6.0])
    process, noise = derivatives(2, time, np.zeros(3)), 0.3 * white_noise(1, 2, time)
    n, p, first = len(time), 6, 1
    H, y, prior = np.eye(3, p), rng.normal(size=(n, 3)), 4.0 * np.eye(p)
    u, P, traces = np.zeros(p), prior, []
    for frame in range(first, n):
        F = process.transition[frame - 1] if frame > first else np.eye(p)
        if frame > first:
            u, P = F @ u, F @ P @ F.T + noise[frame - 1]
        S = H @ P @ H.T + 0.01 * np.eye(3)
        K, nu = P @ H.T @ np.linalg.inv(S), y[frame] - H @ u
        traces.append(Trace(F, P[:p], np.eye(p) - K @ H, H.T @ np.linalg.solve(S, H), H.T @ np.linalg.solve(S, nu)))
        u, P = u + K @ nu, P - K @ H @ P
    empty = np.zeros((1, 0, 3))
    state = State(u[None], np.array([[1.0, 0, 0, 0]]), np.zeros((1, 3)), np.eye(3)[None], empty, P[None])
    found = smoothed_path(state, process, noise, first, tuple(traces))
    information, rhs = np.zeros((n * p, n * p)), np.zeros(n * p)
    information[first * p : first * p + p, first * p : first * p + p] = np.linalg.inv(prior)
    for k in range(n - 1):
        step = np.hstack([-process.transition[k], np.eye(p)])
        pair = slice(k * p, k * p + 2 * p)
        information[pair, pair] += step.T @ np.linalg.solve(noise[k], step)
    for k in range(first, n):
        own = slice(k * p, k * p + p)
        information[own, own] += H.T @ H / 0.01
        rhs[own] += H.T @ y[k] / 0.01
    covariance = np.linalg.inv(information)
    np.testing.assert_allclose(found.u.ravel(), covariance @ rhs, atol=1e-8)
    for k in range(n):
        np.testing.assert_allclose(found.covariance[k], covariance[k * p : k * p + p, k * p : k * p + p], atol=1e-8)
    assert isinstance(found.process, PathProcess)
