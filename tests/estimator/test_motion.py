"""Velocity, attitude and angular rate of an estimate, against the truth and their covariances."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, ScrewOptions, estimate
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from free_paths import FEATURES, NOISE, ORBIT, RATE, at_rest, found_by, in_orbit, turning
from synthetic import ENVISAT, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

FRAMES, DRAWS = 120, 8
STEP = 1e-3  # s, of central differences: they leave the square of it, and rounding over it


@pytest.fixture(scope="module")
def cases():
    time, R = turning(FRAMES)
    return [make_case(time, R, in_orbit(time), FEATURES, noise=NOISE, seed=seed) for seed in range(DRAWS)]


def velocity_of(time):
    return (in_orbit(time + STEP) - in_orbit(time - STEP)) / (2 * STEP)


def in_band(squares):
    """Whether the mean of independent χ²₃ is in its band of 99.9 %."""
    low, high = chi2.ppf([0.0005, 0.9995], 3 * len(squares)) / len(squares)
    return low < np.mean(squares) < high


def squared(error, covariance):
    return float(error @ np.linalg.solve(covariance, error))


@pytest.mark.parametrize("path", [Polynomial(4, 0.0, 100.0), RelativeOrbit(ORBIT.model(), 50.0)], ids=lambda p: p.name)
@pytest.mark.parametrize("count", [7, 5000])
def test_the_rate_of_a_path_is_its_derivative(path, count):
    """By central differences of the position, also where a spline stands between nodes, and of the Jacobian."""
    time, x = np.linspace(0.0, 100.0, count), np.random.default_rng(0).normal(size=path.size) * 10
    rate, before, after = path.rate_at(time), path.at(time - 0.01), path.at(time + 0.01)
    np.testing.assert_allclose(rate.position(x), (after.position(x) - before.position(x)) / 0.02, atol=1e-6)
    np.testing.assert_allclose(rate.jacobian, (after.jacobian - before.jacobian) / 0.02, atol=1e-6)


@pytest.mark.parametrize("noise", ["none", "auto"])
@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_velocity_error_agrees_with_its_covariance(method, noise, cases):
    """Process noise that is not there, but not excluded, makes the claim wider than the error."""
    true, k = velocity_of(cases[0].tracks.time), FRAMES // 2
    squares = []
    for case in cases:
        found = found_by(method, case.tracks, "relative-orbit", process_noise=noise)
        squares.append(squared(found.velocity[k] - true[k], found.motion.velocity_covariance[k]))
    assert in_band(squares)


def wandering(time, density, rng):
    """Position and velocity (n, 3) under white acceleration of a density in m²/s³, from rest."""
    step = float(time[1] - time[0])
    noise = np.linalg.cholesky(density * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]]))
    state = np.zeros((len(time), 2, 3))
    for k in range(1, len(time)):
        state[k] = np.array([[1.0, step], [0.0, 1.0]]) @ state[k - 1] + noise @ rng.standard_normal((2, 3))
    return state[:, 0] + at_rest(time), state[:, 1]


@pytest.mark.parametrize("method", ["pivot", "ml"])
def test_velocity_error_under_process_noise_agrees_with_its_covariance(method):
    """Modes that are too many to be estimated hardly move the path, but the velocity."""
    (time, R), density, k = turning(FRAMES), 1e-5, FRAMES // 2
    squares = []
    for draw in range(DRAWS):
        path, velocity = wandering(time, density, np.random.default_rng([71, draw]))
        tracks = make_case(time, R, path, FEATURES, noise=NOISE, seed=draw).tracks
        options = PathOptions(trajectory="polynomial:1", process_noise=density, sigma=NOISE)
        found = estimate(tracks, method=method, options=options)
        squares.append(squared(found.velocity[k] - velocity[k], found.motion.velocity_covariance[k]))
        predicted = found.predict(time).covariance[:, 3:, 3:]
        np.testing.assert_allclose(found.motion.velocity_covariance, predicted, rtol=1e-6, atol=1e-12)
    assert in_band(squares)


def test_velocity_on_a_polynomial_by_the_filter_and_by_screws(cases):
    case = cases[0]
    filtered = found_by("ekf", case.tracks, "polynomial:2")
    np.testing.assert_allclose(
        filtered.velocity[1:-1], (filtered.position[2:] - filtered.position[:-2]) / 2, rtol=1e-3, atol=1e-5
    )
    for axes in ("inertial", "lvlh"):
        options = ScrewOptions(axes=axes, degree=2)
        screws = estimate(case.tracks, method="screw-gpa", orbit=ORBIT.model(), options=options)
        np.testing.assert_allclose(
            screws.velocity[1:-1], (screws.position[2:] - screws.position[:-2]) / 2, rtol=1e-3, atol=1e-4
        )


def test_velocity_at_rest_in_lvlh(cases):
    found = estimate(cases[0].tracks, method="score", orbit=ORBIT.model())
    np.testing.assert_allclose(found.velocity[1:-1], (found.position[2:] - found.position[:-2]) / 2, atol=1e-7)


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_attitude_and_rate_errors_agree_with_their_covariances(method, cases):
    """In axes attached to the features, by scipy's alignment of their estimated points with the true ones.

    In those of the equations, which have no error at the epoch, `ml` claimed to know the attitude there exactly.
    """
    time, R = turning(FRAMES)
    truth = Rotation(0.0, np.eye(3), RATE, ENVISAT).at(time)
    squares = {(what, k): [] for what in ("attitude", "rate") for k in (0, FRAMES // 2, FRAMES - 1)}
    for case in cases[:: 2 if method == "ekf" else 1]:
        found = found_by(method, case.tracks, "relative-orbit", torque="none")
        cluster, motion = found.clusters[0], found.motion
        true = FEATURES[cluster.features]
        R_S_B = ScipyRotation.align_vectors(cluster.points, true - true.mean(axis=0))[0].as_matrix()
        turned = ScipyRotation.from_matrix(np.swapaxes(R @ R_S_B.T, 1, 2) @ found.attitude).as_rotvec()
        rate = found.angular_rate - truth.rate @ R_S_B.T
        for k in (0, FRAMES // 2, FRAMES - 1):
            squares["attitude", k].append(squared(turned[k], motion.attitude_covariance[k]))
            squares["rate", k].append(squared(rate[k], motion.angular_rate_covariance[k]))
    for which, values in squares.items():
        assert in_band(values), which


def test_attitude_errors_of_pivot_agree_with_their_covariances(cases):
    _, R = turning(FRAMES)
    squares = []
    for case in cases[:3]:
        found = found_by("pivot", case.tracks, "relative-orbit")
        mean = ScipyRotation.from_matrix(np.swapaxes(R, 1, 2) @ found.attitude).mean().as_matrix()
        turned = ScipyRotation.from_matrix(mean.T @ np.swapaxes(R, 1, 2) @ found.attitude).as_rotvec()
        squares += [squared(t, C) for t, C in zip(turned, found.motion.attitude_covariance, strict=True)]
    assert in_band(squares)


def test_attitude_is_nan_where_the_body_is_not_seen(cases):
    tracks = cases[0].tracks
    position = tracks.position.copy()
    position[40:60] = np.nan
    hidden = FeatureTracks(tracks.time, position, tracks.labels)
    found = estimate(hidden, orbit=ORBIT.model(), options=PathOptions(trajectory="relative-orbit"))
    assert np.isnan(found.attitude[40:60]).all()
    assert np.isfinite(found.attitude[[39, 60]]).all()
    assert not found.covered[40:60].any()
    assert np.isnan(found.residuals[40:60]).all()
