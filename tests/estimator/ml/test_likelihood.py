"""The joint normal equations against the dense problem: differences of the residuals by all unknowns."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.dynamics.torque import Torque
from baryscope.estimator.ml.jacobians import Knots, worthwhile
from baryscope.estimator.ml.likelihood import equations
from baryscope.estimator.ml.model import FrameNoise, Model
from baryscope.estimator.paths.blocks import Blocks
from baryscope.estimator.paths.path import Polynomial
from synthetic import ENVISAT, differences, roots, turned_back

N, M, P, Q = 12, 6, 6, 14  # frames, features, unknowns of the path, and of path and motion
TIME = np.arange(0.0, 5.0 * N, 5.0)
PATH = Polynomial(1, 0.0, TIME[-1])
X = np.array([4.0, -19.0, 3.0, 0.5, 0.2, -0.3])
# Changes of about one in what these are units of: rate, inertia, path, points.
UNITS = np.concatenate([np.full(3, 1e-2), np.full(5, 1e-1), np.ones(P + 3 * M)])


def scene(full, seed=0):
    rng = np.random.default_rng(seed)
    start = Rotation(20.0, ScipyRotation.random(random_state=seed).as_matrix(), np.array([0.03, 0.05, 0.04]), ENVISAT)
    points = rng.normal(size=(M, 3)) * 2
    sampled, motion = PATH.at(TIME), start.at(TIME)
    origin = sampled.position(X)
    position = origin[:, None] + points @ np.swapaxes(motion.attitude, 1, 2) + 0.1 * rng.normal(size=(N, M, 3))
    used = rng.random((N, M)) < 0.7
    used[:, 5] = False  # never seen
    precision = None
    if full:
        factor = rng.normal(size=(N, M, 3, 3))
        precision = factor @ np.swapaxes(factor, 2, 3) + 0.3 * np.eye(3)
    observations = Observations(
        np.where(used[..., None], position, 0.0), np.where(used, rng.uniform(0.5, 2, (N, M)), 0.0), precision
    )
    return start, sampled, motion, origin, observations, points + 0.05 * rng.normal(size=(M, 3))


def whitened(start, sampled, observations, points):
    """Residuals as a function of all unknowns, in UNITS: rate, inertia, x and δb."""
    root = roots(observations.weight, observations.precision)

    def function(unknowns):
        values = UNITS * unknowns
        attitude = start.changed(np.zeros(3), values[:8]).at(TIME).attitude
        model = sampled.position(X + values[8:Q])[:, None]
        model = model + (points + values[Q:].reshape(M, 3)) @ np.swapaxes(attitude, 1, 2)
        return (root @ (observations.position - model)[..., None]).ravel()

    return function


@pytest.fixture(scope="module", params=[False, True], ids=["isotropic", "precisions"])
def problem(request):
    """What `equations` finds, and residual, Jacobian and matrix of the dense problem without the feature not seen."""
    start, sampled, motion, origin, observations, points = scene(request.param)
    function = whitened(start, sampled, observations, points)
    zero = np.zeros(Q + 3 * M)
    residual, J = function(zero), differences(function, zero, 1e-4) / UNITS
    return equations(observations, Model(motion, sampled, origin, points)), points, residual, J[:, : Q + 3 * (M - 1)]


def assert_is_schur_complement(found, matrix, rhs, tolerances):
    """The equations without the points, which dense normal equations have after the Q unknowns; each in its size."""
    known = matrix[Q:, Q:]
    eliminated = matrix[:Q, :Q] - matrix[:Q, Q:] @ np.linalg.solve(known, matrix[Q:, :Q])
    expected = rhs[:Q] - matrix[:Q, Q:] @ np.linalg.solve(known, rhs[Q:])
    size = np.sqrt(np.diag(eliminated))
    np.testing.assert_allclose(
        found.matrix / np.outer(size, size), eliminated / np.outer(size, size), atol=tolerances[0]
    )
    np.testing.assert_allclose(found.rhs / size, expected / size, atol=tolerances[1])


def test_matrix_is_the_schur_complement(problem):
    found, _, residual, J = problem
    # Between nodes the sensitivity is a cubic: (0.4 rad)⁴/384 = 7e-5 of it.
    assert_is_schur_complement(found, J.T @ J, -J.T @ residual, (1e-4, 1e-4))


def test_points_are_the_linear_least_squares_for_a_given_motion(problem):
    found, points, residual, J = problem
    change = np.linalg.lstsq(J[:, Q:], -residual, rcond=None)[0]
    np.testing.assert_allclose(found.points[:5], points[:5] + change.reshape(-1, 3), atol=1e-7)
    np.testing.assert_array_equal(found.points[5], points[5])  # never seen: as it was
    assert found.cost == pytest.approx(float(np.sum((residual + J[:, Q:] @ change) ** 2)), rel=1e-9)


def test_covariances_agree_with_the_dense_inverse(problem):
    found, _, _, J = problem
    units = UNITS[: J.shape[1]]
    covariance = np.linalg.inv((J * units).T @ (J * units)) * np.outer(units, units)
    deviation = np.sqrt(np.diag(covariance)[:Q])
    y = found.covariance(PATH.at(TIME), distance=1e9)
    size = np.outer(deviation, deviation)
    np.testing.assert_allclose(y / size, covariance[:Q, :Q] / size, atol=1e-3)
    members = np.array([0, 2, 3, 4])
    places = Q + (3 * members[:, None] + np.arange(3)).ravel()
    reference = found.points[members]
    held = differences(lambda p: turned_back(p.reshape(-1, 3), reference), reference.ravel(), 1e-5)
    expected = held @ covariance[np.ix_(places, places)] @ held.T
    offset, crossed = found.offset_covariance(y, members)
    np.testing.assert_allclose(offset, expected, atol=1e-3 * np.abs(expected).max())
    size = np.sqrt(np.outer(np.diag(expected), np.diag(covariance)[:Q]))
    np.testing.assert_allclose(crossed / size, held @ covariance[np.ix_(places, np.arange(Q))] / size, atol=1e-3)


def test_a_direction_lost_in_rounding_has_the_variance_of_its_prior(problem):
    """One of inertia and path together: information 1e16 on all others hides 4 on each, which bounds both to 1/2.

    By the path alone, of which it has a hundredth, it would be a hundred times as wide as the path may be.
    """
    direction = np.zeros(Q)
    direction[[5, 8]] = 1.0, 0.01
    direction /= np.linalg.norm(direction)
    found = replace(problem[0], matrix=1e16 * (np.eye(Q) - np.outer(direction, direction)), sizes=np.full(Q, 1e16))
    y = found.covariance(PATH.at(TIME), distance=100.0, prior=4 * np.eye(Q))
    np.testing.assert_allclose(y, np.outer(direction, direction) / 4, atol=1e-6)


def test_many_frames_agree_with_one_of_their_total_weight():
    """More frames than a chunk holds, all at one time, against one frame with their weight together."""
    start, *_ = scene(full=False)
    n = 20_000
    points = np.random.default_rng(0).normal(size=(4, 3))
    times = np.repeat([0.0, 30.0, 60.0, 90.0], n // 4)
    few_times = times[:: n // 4]
    path = Polynomial(0, 0.0, 90.0)
    x = np.array([4.0, -19.0, 3.0])
    found = []
    for time, weight in ((times, 1.0), (few_times, n / 4)):
        motion, sampled = start.at(time), path.at(time)
        position = x + points @ np.swapaxes(motion.attitude, 1, 2)
        observations = Observations(position + np.array([0.01, 0, 0]), np.full(position.shape[:2], weight))
        found.append(equations(observations, Model(motion, sampled, sampled.position(x), points)))
    np.testing.assert_allclose(found[0].matrix, found[1].matrix, rtol=1e-9, atol=1e-9 * np.abs(found[1].matrix).max())
    np.testing.assert_allclose(found[0].points, found[1].points, atol=1e-9)
    assert found[0].cost == pytest.approx(found[1].cost, rel=1e-9)


def test_unobserved_directions_get_the_given_displacement():
    """In a spin about a principal axis, the position of the centre of mass along it is not observable."""
    start = Rotation(30.0, np.eye(3), np.array([0.0, 0.0, 0.07]), np.diag([1.0, 2.0, 2.5]))
    path = Polynomial(0, 0.0, 60.0)
    motion, sampled = start.at(TIME), path.at(TIME)
    points = np.random.default_rng(0).normal(size=(5, 3))
    position = X[:3] + points @ np.swapaxes(motion.attitude, 1, 2)
    observations = Observations(position, np.ones((N, 5)))
    found = equations(observations, Model(motion, sampled, sampled.position(X[:3]), points))
    y = found.covariance(sampled, distance=20.0)
    assert np.sqrt(y[10, 10]) == pytest.approx(20.0, rel=1e-3)
    assert np.sqrt(y[8, 8]) < 1.0
    offset, _ = found.offset_covariance(y, np.arange(5))
    assert np.sqrt(offset[2, 2]) == pytest.approx(20.0, rel=1e-3)


def test_blocks_agree_with_every_frame():
    """Jacobians at twelve knots of each block against those of all 1000 frames, with precisions and without."""
    rng = np.random.default_rng(1)
    n, m = 1000, 5
    time = np.sort(rng.uniform(0.0, 60.0, n))
    rotation = Rotation(
        20.0, np.eye(3), np.array([0.03, 0.05, 0.04]), ENVISAT, torque=Torque.none(0.0, 60.0, np.arange(3))
    )
    path = Polynomial(2, 0.0, 60.0)
    motion, sampled, points = rotation.at(time), path.at(time), rng.normal(size=(m, 3))
    origin = sampled.position(np.arange(9.0))
    factor = rng.normal(size=(n, m, 3, 3))
    observations = Observations(
        origin[:, None] + points @ np.swapaxes(motion.attitude, 1, 2) + 0.1 * rng.normal(size=(n, m, 3)),
        (rng.random((n, m)) < 0.8) * 1.0,
        factor @ np.swapaxes(factor, 2, 3) + 0.3 * np.eye(3),
    )
    blocks = Blocks.over(time, 6.0)
    assert worthwhile(blocks)
    assert len(blocks.knots) == 10
    turn, shift = (np.tile(np.diag(one), (n, 1, 1)) for one in ([1e-4, 1e-4, 1e-4], [0.1, 0.2, 0.0]))
    noise = FrameNoise(turn, shift)
    knots = Knots(blocks, motion, path.at(blocks.knots.ravel()).jacobian)
    for frames, seen in product((None, noise), (observations, replace(observations, precision=None))):
        model = Model(motion, sampled, origin, points, frames)
        every, few = equations(seen, model), equations(seen, replace(model, knots=knots))
        scale = np.sqrt(np.outer(np.diag(every.matrix), np.diag(every.matrix)))
        # The rotation's Jacobian, of cubics between its nodes, is a polynomial in no block.
        np.testing.assert_allclose(few.matrix / scale, every.matrix / scale, atol=1e-6)
        size = np.sqrt(np.diag(every.matrix))
        np.testing.assert_allclose(few.rhs / size, every.rhs / size, atol=1e-5 * np.abs(every.rhs / size).max())
        np.testing.assert_allclose(few.points, every.points, atol=1e-12)
        np.testing.assert_allclose(few.by_unknowns, every.by_unknowns, atol=1e-4 * np.abs(every.by_unknowns).max())


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_frame_noise_agrees_with_the_dense_covariance(full):
    """Turns about the chaser and shifts of whole frames, in the covariance of all observations."""
    start, sampled, motion, origin, observations, points = scene(full)
    rng = np.random.default_rng(3)
    turn, shift = (size * rng.normal(size=(N, 3, 3)) for size in (1e-2, 0.2))
    turn, shift = turn @ np.swapaxes(turn, 1, 2), shift @ np.swapaxes(shift, 1, 2)
    shift[0] = 0.0
    found = equations(observations, Model(motion, sampled, origin, points, FrameNoise(turn, shift)))
    function = whitened(start, sampled, observations, points)
    zero = np.zeros(Q + 3 * M)
    residual, J = function(zero), (differences(function, zero, 1e-4) / UNITS)[:, : Q + 3 * (M - 1)]
    root = roots(observations.weight, observations.precision)
    covariance = np.eye(len(residual))
    in_C = origin[:, None] + points @ np.swapaxes(motion.attitude, 1, 2)
    for k in range(N):
        by_turn = np.cross(np.eye(3), in_C[k][:, None]).transpose(0, 2, 1)  # ε × p
        moved = np.concatenate([root[k] @ by_turn, root[k] @ np.eye(3)], axis=2).reshape(3 * M, 6)
        own = slice(3 * M * k, 3 * M * (k + 1))
        covariance[own, own] += moved @ block_diag(turn[k], shift[k]) @ moved.T
    inverse = np.linalg.inv(covariance)
    matrix, rhs = J.T @ inverse @ J, -J.T @ inverse @ residual
    known = matrix[Q:, Q:]
    assert_is_schur_complement(found, matrix, rhs, (2e-4, 1e-3))
    change = np.linalg.solve(known, rhs[Q:])
    np.testing.assert_allclose(found.points[:5], points[:5] + change.reshape(-1, 3), atol=1e-6)
    left = residual + J[:, Q:] @ change
    # The lever arms are those of the new points, which have moved by centimetres.
    assert found.cost == pytest.approx(float(left @ inverse @ left), rel=1e-3)
    np.testing.assert_allclose(found.covariance_of_points(np.arange(5)), np.linalg.inv(known), atol=1e-9)
