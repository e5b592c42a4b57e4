"""Predictions in gaps and ahead: errors of draws with process noise agree with the covariances, points included."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, ScrewOptions, estimate
from baryscope.estimator.dynamics.paths import Polynomial
from baryscope.estimator.prediction import PredictedPath, Widening
from baryscope.estimator.result import FreeAttitudes
from baryscope.models.errors import ComputationError, InputError
from free_paths import FEATURES, NOISE, RATE, at_rest, found_by, in_orbit, turning
from synthetic import make_case

FRAMES, AHEAD, DRAWS = 160, 60, 16
DENSITY = 1e-8  # m²/s³: 13 mm after 60 s
GAP = slice(70, 100)
HINGE = np.array([1.0, -2.0, 0.5])  # in the body's axes from the centre of mass, m


def drifted(time, seed):
    """Positions and velocities (n, 3) of a motion by white acceleration, by its exact steps."""
    rng, state = np.random.default_rng(seed), np.zeros((2, 3))
    states = [state]
    for step in np.diff(time):
        root = np.linalg.cholesky(DENSITY * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]]))
        state = np.array([[1, step], [0, 1]]) @ state + root @ rng.standard_normal((2, 3))
        states.append(state)
    return np.moveaxis(np.array(states), 1, 0)


@pytest.fixture(scope="module")
def draws():
    """Tracks with a gap, and positions and velocities of the centre of mass from there to the prediction's end."""
    time, R = turning(FRAMES + AHEAD)
    found = []
    for seed in range(DRAWS):
        moved, speed = drifted(time, seed)
        com = at_rest(time) + moved
        tracks = make_case(time[:FRAMES], R[:FRAMES], com[:FRAMES], FEATURES, noise=NOISE, seed=100 + seed).tracks
        position = tracks.position.copy()
        position[GAP] = np.nan
        found.append((FeatureTracks(tracks.time, position, tracks.labels), com, speed))
    return found


@pytest.fixture(scope="module")
def estimates(draws):
    """The estimates of every draw, as a straight path with estimated process noise."""
    options = PathOptions(trajectory="polynomial:1")
    return {
        method: [estimate(tracks, method=method, options=options) for tracks, _, _ in draws]
        for method in ("pivot", "ml", "ekf")
    }


def in_band(squares, dof):
    """Whether the mean of independent χ² is in its band of 99.9 %."""
    low, high = chi2.ppf([0.0005, 0.9995], dof * len(squares)) / len(squares)
    return low < np.mean(squares) < high


def squared(prediction, position, velocity):
    error = np.concatenate([prediction.position[0] - position, prediction.velocity[0] - velocity])
    return float(error @ np.linalg.solve(prediction.covariance[0], error))


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_errors_of_position_and_velocity_agree_with_their_covariance(method, draws, estimates):
    """In the gap, at the end, and a minute ahead."""
    squares = {85: [], FRAMES - 1: [], FRAMES + AHEAD - 1: []}
    for (_, com, speed), found in zip(draws, estimates[method], strict=True):
        for k in squares:
            squares[k].append(squared(found.predict([float(k)]), com[k], speed[k]))
    for k, values in squares.items():
        assert in_band(values, 6), k


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_errors_of_a_point_agree_with_its_covariance(method, draws, estimates):
    """A feature, and a point given by coordinates from the features' centroid, on a turning body."""
    time, R = turning(FRAMES + AHEAD)
    turned = np.cross(RATE, HINGE)
    assert np.linalg.norm(turned) > 0.1  # the point moves
    squares = {"F2": [], "hinge": []}
    centroid = FEATURES.mean(axis=0)
    end = len(time) - 1
    for (_, com, speed), found in zip(draws, estimates[method], strict=True):
        # The body's axes are arbitrary: those of the result, from the features.
        axes = np.linalg.svd(found.clusters[0].points.T @ (FEATURES - centroid))
        R_S_B = axes[0] @ np.diag([1, 1, np.linalg.det(axes[0] @ axes[2])]) @ axes[2]
        for name, point, asked in (
            ("F2", FEATURES[2], "F2"),
            ("hinge", HINGE, R_S_B @ (HINGE - centroid)),
        ):
            position = com[end] + R[end] @ point
            rate = (R[end] - R[end - 2]) @ point / 2  # at end − 1, by central differences
            before = found.predict([end - 1.0], asked)
            assert np.linalg.norm(before.velocity[0] - speed[end - 1] - rate) < 0.05 * np.linalg.norm(rate)
            error = found.predict([float(end)], asked)
            off = error.position[0] - position
            squares[name].append(float(off @ np.linalg.solve(error.covariance[0, :3, :3], off)))
    assert in_band(squares["F2"], 3)
    assert in_band(squares["hinge"], 3)


def test_at_the_tracks_times_it_is_the_estimate():
    """Position, velocity and their covariances, but for the modes of noise that only a prediction counts."""
    time, R = turning(200)
    tracks = make_case(time, R, in_orbit(time), FEATURES, noise=NOISE).tracks
    for method in ("pivot", "ml", "ekf"):
        found = found_by(method, tracks, "relative-orbit", process_noise="none")
        at = found.predict(time)
        np.testing.assert_allclose(at.position, found.position, atol=1e-9)
        np.testing.assert_allclose(at.velocity, found.velocity, atol=1e-12)
        np.testing.assert_allclose(at.covariance[:, :3, :3], found.covariance, rtol=1e-9, atol=1e-18)
        np.testing.assert_allclose(at.covariance[:, 3:, 3:], found.motion.velocity_covariance, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_the_velocity_of_a_point_is_the_derivative_of_its_position(method):
    time, R = turning(200)
    found = found_by(method, make_case(time, R, in_orbit(time), FEATURES, noise=NOISE).tracks, "relative-orbit")
    around = found.predict([249.99, 250.0, 250.01], (0.5, 1.0, -2.0))
    slope = (around.position[2] - around.position[0]) / 0.02
    np.testing.assert_allclose(around.velocity[1], slope, atol=1e-6)
    assert np.linalg.norm(slope) > 0.1
    assert (np.linalg.eigvalsh(around.covariance) > 0).all()


def test_what_is_widened_twice_is_as_wide_as_both_make_it():
    """As of a result that is wider by its camera's errors, and then by a misfit."""
    path = PredictedPath(Polynomial(1, 0.0, 10.0), np.zeros(6), np.diag(np.arange(1.0, 7.0)), 0.0, 10.0)
    first, second, ahead = Widening(2.0, 0.3, 0.01), Widening(1.5, 0.1, 0.02), np.array([5.0, 20.0])
    alone = path.at(ahead, None).covariance
    expected = second.of_both(first.of_both(alone, ahead - 10.0), ahead - 10.0)
    np.testing.assert_allclose(path.widened(first).widened(second).at(ahead, None).covariance, expected, rtol=1e-12)


def test_what_cannot_be_predicted_is_said_in_a_line():
    time, R = turning(60)
    tracks = make_case(time, R, at_rest(time), FEATURES, noise=NOISE).tracks
    pivot, screws = found_by("pivot", tracks, "fixed"), estimate(tracks, method="screw-gpa", options=ScrewOptions())
    ml = found_by("ml", tracks, "fixed")
    with pytest.raises(InputError, match=r"point: pivot has attitudes in its frames only, .*, expected ml or ekf"):
        pivot.predict([70.0], "F1")
    with pytest.raises(InputError, match="screw-gpa predicts nothing, expected pivot, ml or ekf"):
        screws.predict([70.0])
    free = replace(ml, predictor=pivot.predictor, findings=(FreeAttitudes("the steps do not converge"),))
    with pytest.raises(ComputationError, match="the steps do not converge: no point can be predicted without a tumble"):
        free.predict([70.0], "F1")
    with pytest.raises(InputError, match="point is 'hinge', expected a feature's label or three coordinates"):
        ml.predict([70.0], "hinge")
    with pytest.raises(InputError, match=r"point is .*, expected a feature's label or three coordinates within"):
        ml.predict([70.0], (1.0, np.nan, 0.0))
    with pytest.raises(InputError, match="times: found -1 s, expected at or after the first frame, 0 s"):
        pivot.predict([70.0, -1.0])
    with pytest.raises(InputError, match="times: expected finite numbers"):
        pivot.predict([np.inf])
