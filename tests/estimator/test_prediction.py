"""Predictions back, in gaps and ahead: errors of draws with process noise agree with the covariances, points too."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, ScrewOptions, estimate
from baryscope.estimator.claims import with_wider
from baryscope.estimator.findings import FreeAttitudes, UnknownPush
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.prediction import PredictedPath
from baryscope.estimator.widening import UncheckedLaw, Widening
from baryscope.models.errors import ComputationError, InputError
from free_paths import FEATURES, NOISE, ORBIT, RATE, at_rest, found_by, in_orbit, pushed, turning
from results import an_estimate
from synthetic import box_features, make_case

pytestmark = pytest.mark.usefixtures("shared_pivot")

BEFORE, FRAMES, AHEAD, DRAWS = 60, 160, 60, 7
TRACKED = slice(BEFORE, BEFORE + FRAMES)
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


def test_an_error_of_the_velocity_moves_what_is_beyond_and_is_correlated_with_it():
    """Of p + v τ and v, for independent p and v: [σp² + σv² τ², σv² τ; σv² τ, σv²], before the tracks with τ < 0."""
    plain, by = an_estimate(), Widening(2.0, 0.09, 0.04)
    known = PredictedPath(Polynomial(0, 0.0, 9.0), np.zeros(3), np.eye(3), 0.0, 9.0)
    found = with_wider(replace(plain, predictor=known), plain.covariance, plain.clusters, plain.motion, by)
    for time, tau in ((-5.0, -5.0), (4.0, 0.0), (12.0, 3.0)):
        own = [[2.0 + 0.09 + 0.04 * tau**2, 0.04 * tau], [0.04 * tau, 0.04]]
        np.testing.assert_allclose(found.predict(time).covariance[0], np.kron(own, np.eye(3)), atol=1e-12)


def test_what_few_modes_leave_out_stands_in_the_covariance():
    """Of q ∫∫ dW less its straight line the mean variance is q T³/420, as that of a position on a beam: what is not in
    two modes is in the others, of which those beyond the ninth of their number have a seven-hundredth of it.
    """
    path = ProcessNoisePath(Polynomial(1, 0.0, 20.0), 0.0, 20.0, 2)
    known = PredictedPath(path, np.zeros(path.size), np.zeros((path.size, path.size)), 0.0, 20.0, DENSITY)
    added = known.added((np.arange(4000) + 0.5) * 20.0 / 4000)[:, :3, :3].mean(axis=0)
    modes = DENSITY * np.exp(path.prior.offset[6::3]).sum()
    np.testing.assert_allclose(added, (DENSITY * 20.0**3 / 420 - modes) * np.eye(3), rtol=0.01, atol=1e-12)


@cache
def draws():
    """Tracks with a gap, and positions and velocities of the centre of mass from long before to long after them."""
    time, R = turning(BEFORE + FRAMES + AHEAD)
    found = []
    for seed in range(DRAWS):
        moved, speed = drifted(time, seed)
        com = at_rest(time) + moved
        tracks = make_case(time[TRACKED], R[TRACKED], com[TRACKED], FEATURES, noise=NOISE, seed=100 + seed).tracks
        position = tracks.position.copy()
        position[GAP] = np.nan
        found.append((FeatureTracks(tracks.time, position, tracks.labels), com, speed))
    return found


@cache
def estimates(method):
    """A method's estimates of every draw, as a straight path with estimated process noise."""
    options = PathOptions(trajectory="polynomial:1")
    return [estimate(tracks, method=method, options=options) for tracks, _, _ in draws()]


def in_band(squares, dof):
    """Whether the mean of independent χ² is in its band of 99.9 %."""
    low, high = chi2.ppf([0.0005, 0.9995], dof * len(squares)) / len(squares)
    return low < np.mean(squares) < high


def squared(prediction, position, velocity):
    """The normalised squares (n,) of the errors at n times."""
    error = np.concatenate([prediction.position - position, prediction.velocity - velocity], axis=1)[:, :, None]
    return np.sum(error * np.linalg.solve(prediction.covariance, error), axis=(1, 2))


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_errors_of_position_and_velocity_agree_with_their_covariance(method):
    """A minute before the first frame, there, in the gap, at the last frame, and a minute later."""
    asked = [0, BEFORE, BEFORE + 85, BEFORE + FRAMES - 1, BEFORE + FRAMES + AHEAD - 1]
    squares = [
        squared(found.predict(np.array(asked, dtype=float)), com[asked], speed[asked])
        for (_, com, speed), found in zip(draws(), estimates(method), strict=True)
    ]
    for k, values in zip(asked, np.transpose(squares), strict=True):
        assert in_band(values, 6), k


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_errors_of_a_point_agree_with_its_covariance(method):
    """A feature, and a point given by coordinates from the features' centroid, on a turning body, back and ahead."""
    time, R = turning(BEFORE + FRAMES + AHEAD)
    turned = np.cross(RATE, HINGE)
    assert np.linalg.norm(turned) > 0.1  # the point moves
    centroid, ends = FEATURES.mean(axis=0), (0, len(time) - 1)
    squares = {(name, end): [] for name in ("F2", "hinge") for end in ends}
    for (_, com, speed), found in zip(draws(), estimates(method), strict=True):
        # The body's axes are arbitrary: those of the result, from the features.
        axes = np.linalg.svd(found.clusters[0].points.T @ (FEATURES - centroid))
        R_S_B = axes[0] @ np.diag([1, 1, np.linalg.det(axes[0] @ axes[2])]) @ axes[2]
        for name, point, asked in (("F2", FEATURES[2], "F2"), ("hinge", HINGE, R_S_B @ (HINGE - centroid))):
            for end, near in zip(ends, (1, ends[1] - 1), strict=True):
                rate = (R[near + 1] - R[near - 1]) @ point / 2  # by central differences
                both = found.predict([float(near), float(end)], asked)
                assert np.linalg.norm(both.velocity[0] - speed[near] - rate) < 0.05 * np.linalg.norm(rate)
                off = both.position[1] - com[end] - R[end] @ point
                squares[name, end].append(float(off @ np.linalg.solve(both.covariance[1, :3, :3], off)))
    for (name, end), values in squares.items():
        assert in_band(values, 3), (name, end)


@pytest.mark.parametrize(
    ("method", "axes", "size"),
    [
        ("pivot", "inertial", 1e-6),
        ("pivot", "lvlh", 1e-5),
        ("ml", "inertial", 1e-5),
        ("ml", "lvlh", 1e-6),
        ("ekf", "inertial", 1e-6),
        ("ekf", "lvlh", 1e-5),
    ],
)
def test_a_force_that_lasts_may_go_on(method, axes, size):
    """Constant accelerations on an orbit that are not told, up to one span ahead, against two integrated orbits.

    They are found, in the axes in which they are constant, and followed: the NEES exceeds the limit once in ten
    thousand. Noise that has to stand for them grows with T³ in variance, the path with T⁴. Each method has
    both axes and both sizes, and each of the axes both sizes.
    """
    (time, R), count = turning(300, 5.0, 0.3), 300
    asked = time[-1] * np.array([1.25, 1.5, 2.0])
    true = pushed(np.append(time, asked), size * np.array([1.0, -0.5, 0.3]), axes)
    tracks = make_case(time, R, true[:count, :3], FEATURES, noise=NOISE).tracks
    found = estimate(tracks, method=method, orbit=ORBIT.model())
    assert [one.axes for one in found.findings if isinstance(one, UnknownPush)] == [axes]
    squares = squared(found.predict(asked), true[count:, :3], true[count:, 3:])
    assert (squares < chi2.ppf(1 - 1e-4, 6)).all(), squares


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_a_smooth_path_goes_on_by_what_is_told_at_its_end(method):
    """Without an orbit, a quarter of the span and one span before and after: truth by two Kepler orbits.

    An error is beyond the limit once in a million; a span away the claim is less than what the path turns away from a
    straight line by. A polynomial of a high degree leads anywhere there.
    """
    time, R = turning(200)
    span, limit = time[-1] - time[0], chi2.ppf(1 - 1e-6, 6)
    asked, step = np.array([-span, -span / 4, span + span / 4, 2 * span]), 0.5
    true = in_orbit(np.concatenate([asked - step, asked, asked + step])).reshape(3, -1, 3)
    speed = (true[2] - true[0]) / (2 * step)
    end = in_orbit(np.array([0.0, step, span - step, span]))
    straight = np.where(
        asked[:, None] < 0,
        end[0] + asked[:, None] * (end[1] - end[0]) / step,
        end[3] + (asked[:, None] - span) * (end[3] - end[2]) / step,
    )
    found = estimate(make_case(time, R, in_orbit(time), FEATURES, noise=NOISE).tracks, method=method)
    assert found.path == "polynomial"
    there = found.predict(asked)
    assert (squared(there, true[1], speed) < limit).all()
    claimed = np.sqrt(np.trace(there.covariance[:, :3, :3], axis1=1, axis2=2))
    assert (claimed[[0, 3]] < np.linalg.norm(true[1] - straight, axis=1)[[0, 3]]).all()


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_looking_back_is_looking_ahead_on_a_film_that_runs_backwards(method):
    """With white noise of path and torque; in free space, where motions can be run backwards."""
    time, R = turning(160)
    moved = at_rest(time) + drifted(time, 3)[0]
    tracks = make_case(time, R, moved, FEATURES, noise=NOISE).tracks
    backwards = FeatureTracks(time[-1] - time[::-1], tracks.position[::-1], tracks.labels)
    options = PathOptions(
        trajectory="polynomial:1", process_noise=DENSITY, torque="none", torque_noise=1e-12, sigma=NOISE
    )
    forth, back = (estimate(one, method=method, options=options) for one in (tracks, backwards))
    asked = time[-1] + np.array([0.0, 10.0, 60.0])
    signs = np.repeat([1.0, -1.0], 3)
    for point in (None,) if method == "pivot" else (None, "F3", (0.5, -1.0, 2.0)):
        ahead, behind = forth.predict(asked, point), back.predict(time[-1] - asked, point)
        deviation = np.sqrt(np.diagonal(ahead.covariance, axis1=1, axis2=2))
        if not isinstance(point, tuple):  # the axes of the result depend on the frame they are defined by
            np.testing.assert_array_less(np.abs(behind.position - ahead.position), 0.05 * deviation[:, :3])
            np.testing.assert_array_less(np.abs(-behind.velocity - ahead.velocity), 0.05 * deviation[:, 3:])
            scaled = (behind.covariance * np.outer(signs, signs) - ahead.covariance) / (
                deviation[:, :, None] * deviation[:, None]
            )
            np.testing.assert_allclose(scaled, 0.0, atol=0.03)
        assert (np.linalg.eigvalsh(behind.covariance) > 0).all()


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
    first, second, ahead = Widening(2.0, 0.3, 0.01), Widening(1.5, 0.1, 0.02), np.array([-8.0, 5.0, 20.0])
    found = an_estimate(time=np.arange(11.0), predictor=path)
    alone = found.predict(ahead).covariance
    np.testing.assert_array_equal(alone, path.at(ahead, None).covariance)
    for by in (first, second):
        found = with_wider(found, found.covariance, found.clusters, found.motion, by)
    expected = second.of_both(first.of_both(alone, ahead, 0.0, 10.0), ahead, 0.0, 10.0)
    np.testing.assert_allclose(found.predict(ahead).covariance, expected, rtol=1e-12)


def test_a_law_that_nothing_checks_is_doubled_before_a_misfit_widens_it():
    """As a result has it: of variances of 1 within and 5 beyond, by 1 + 3 (1 − 1/5), and then by the misfit."""
    time, covariance = np.array([5.0, 20.0]), np.array([1.0, 5.0])[:, None, None] * np.eye(6)
    by = Widening(law=UncheckedLaw(0.0, 10.0, 3, 3.0)).then(Widening(2.0, 0.3))
    found = by.of_both(covariance, time, 0.0, 10.0)
    np.testing.assert_allclose(found[:, :3, :3], np.array([2.3, 2 * 3.4 * 5 + 0.3])[:, None, None] * np.eye(3))
    np.testing.assert_allclose(found[:, 3:, 3:], np.array([2.0, 2 * 3.4 * 5])[:, None, None] * np.eye(3))


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
    with pytest.raises(InputError, match="times: expected finite numbers"):
        pivot.predict([np.inf])
    with pytest.raises(InputError, match=r"times: found timedelta64\[m\], expected real numbers"):
        pivot.predict(np.array([2], dtype="timedelta64[m]"))


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_a_feature_of_a_spin_goes_on_from_where_it_was_seen(method):
    """Nothing tells the centre of mass along the axis. Times an error of the axis that displaced features by 27 mm a
    second after the tracks, in which they are known to 6 mm.
    """
    time, axis, points = np.arange(60.0), np.array([0.0, 0.06, 0.08]), box_features(5, (4, 3, 2), seed=1)
    ahead = np.append(time, time[-1] + 1.0)
    true = points @ np.swapaxes(Rotation.from_rotvec(ahead[:, None] * axis).as_matrix(), 1, 2) + [1.0, -20.0, 2.0]
    growth, squares = [], []
    for seed in range(4, 8):
        seen = true[:-1] + 0.01 * np.random.default_rng(seed).normal(size=true[:-1].shape)
        tracks = FeatureTracks(time, seen, tuple("abcde"))
        found = estimate(tracks, method=method, options=PathOptions(trajectory="fixed")).predict(ahead[-2:], "c")
        covariance = found.covariance[:, :3, :3]
        deviations = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
        growth.append(deviations[1] / deviations[0])
        error = found.position[1] - true[-1, 2]
        squares.append(error @ np.linalg.solve(covariance[1], error))
    assert np.median(growth) < 2
    assert sum(squares) < chi2.ppf(1 - 1e-4, 3 * len(squares))
