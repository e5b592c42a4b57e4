"""Products of errors in `ekf`, against moved observations and the nonlinear model."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.ekf.filter import ProcessNoise, filtered
from baryscope.estimator.ekf.linearised import Nodes, Reference, linearised, moved
from baryscope.estimator.ekf.motion import free_motion, integrated_noise
from baryscope.estimator.ekf.products import product_gradient
from baryscope.estimator.ekf.solution import Prior, solve
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.paths.path import Polynomial
from synthetic import ENVISAT, attitude, box_features

FRAMES, FEATURES = 12, 5
NOISE = 0.02  # m


@pytest.fixture(scope="module")
def case():
    """A reference at rest in its path, nodes, and noisy observations of some features."""
    rng = np.random.default_rng(0)
    time, rate = np.arange(float(FRAMES)), np.array([0.06, 0.02, 0.01])
    process = free_motion(Polynomial(1, 0.0, time[-1]), time, np.array([4.0, -19.0, 3.0]), time[-1])
    R, points = attitude(ENVISAT, rate, time), box_features(FEATURES, (10, 5, 5), seed=3)
    deviation, rates = np.zeros((FRAMES, 6)), np.tile(rate, (FRAMES, 1))
    inertia, axis = ENVISAT / np.trace(ENVISAT), np.zeros((FRAMES - 1, 3))
    reference = Reference(process, np.zeros(6), deviation, R, rates, inertia, points, axis)
    nodes = Nodes(time, np.arange(FRAMES))
    position = reference.seen_at(nodes) + NOISE * rng.normal(size=(FRAMES, FEATURES, 3))
    weight = rng.integers(1, 3, (FRAMES, FEATURES)).astype(float)
    return reference, nodes, Observations(position, weight, None)


def solved(case):
    """The system, its noise, and the solution in SI units for observations of a deviation of NOISE."""
    reference, nodes, observations = case
    system = linearised(reference, nodes, observations)
    units = np.zeros((FRAMES - 1, 2, 12, 12))
    units[:, 0, :6, :6] = integrated_noise(nodes.time, nodes.time[-1])
    noise = ProcessNoise(units, np.array([[1e-6, 0.0]]), np.zeros(1))
    q = system.rhs.shape[2] - 1
    solution, _ = solve(system, noise, Prior(np.zeros(q), 1e-6 * np.eye(q)))[0]
    variance = NOISE**2
    return (
        system,
        noise,
        replace(
            solution,
            of_theta=variance * solution.of_theta,
            of_state=variance * solution.of_state,
            crossed=variance * solution.crossed,
            spread=variance * solution.spread,
        ),
    )


def test_the_gradient_is_that_of_frames_that_the_products_move(case):
    """For all pairs of attitude errors and an offset's deviation, against observations moved one frame at a time.

    The second moment of the gradient is Σ Gᵢ E[sᵢ sⱼᵀ] Gⱼᵀ, Gᵢ that of a frame moved by a metre along each axis,
    sᵢ = φᵢ × δ. There are at most eight patterns of φ, which hold its covariance but for a thousandth.
    """
    reference, nodes, observations = case
    system, noise, solution = solved(case)
    along = np.array([0.0, 3.0, 4.0])  # m
    found = product_gradient(system, noise, solution, np.outer(along, along))

    def gradient(position):
        own = linearised(reference, nodes, replace(observations, position=position))
        return filtered(own, noise).cost[0, 1:, 0]

    rest, shifts = gradient(observations.position), np.empty((len(found), FRAMES, 3))
    for k in range(FRAMES):
        for axis in range(3):
            position = observations.position.copy()
            position[k] += reference.attitude[k][:, axis]
            shifts[:, k, axis] = gradient(position) - rest
    by_theta = solution.crossed[:, 6:9] @ np.linalg.inv(solution.of_theta)
    by_theta = np.cross(by_theta - by_theta.mean(axis=0), along, axisa=1, axisb=0, axisc=1)
    full = np.einsum("qka,kap->qp", shifts, by_theta)
    expected = full @ solution.of_theta @ full.T
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found @ found.T / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-3)


def test_a_product_is_what_the_linearised_system_lacks(case):
    """Points moved by δ and attitudes turned by φ: what is seen departs from the sum of both by R (φ × δ)."""
    reference, nodes, _ = case
    turn, delta = np.array([1e-4, -2e-4, 3e-4]), np.array([0.0, 3.0, 4.0])
    q = 5 + 6 + 3
    state, theta = np.zeros((FRAMES, 12)), np.zeros(q + 3 * FEATURES)
    state[:, 6:9], theta[q:] = turn, np.tile(delta, FEATURES)
    both, one, other, none = (
        moved(reference, a * state, b * theta).seen_at(nodes) for a, b in [(1, 1), (1, 0), (0, 1), (0, 0)]
    )
    expected = reference.attitude @ ((exp_rotation(turn) - np.eye(3)) @ delta)
    np.testing.assert_allclose((both - one - other + none)[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(expected, reference.attitude @ np.cross(turn, delta), rtol=1e-3, atol=1e-6)


def test_nothing_is_done_where_products_are_negligible(case):
    system, noise, solution = solved(case)
    assert product_gradient(system, noise, solution, 1e-8 * np.eye(3)).shape[1] == 0
