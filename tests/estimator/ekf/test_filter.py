"""The filter and the smoother against one dense linear system of all nodes."""

import numpy as np
import pytest

from baryscope.estimator.ekf import filter as module
from baryscope.estimator.ekf.filter import FilterHistory, ProcessNoise, filtered, smoothed
from baryscope.estimator.ekf.linearised import INERTIA, Linearised, points_in
from baryscope.estimator.ekf.solution import Prior, log_likelihoods, mixed, solve

N, P, D, C = 7, 6, 12, points_in(6).start + 1 + 3


def positive(rng, *shape):
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2)


@pytest.fixture(scope="module")
def case():
    """A random system with its measurements z = G s + X θ of information Λ, one node without."""
    rng = np.random.default_rng(0)
    transition = np.eye(D) + 0.3 * rng.normal(size=(N - 1, D, D))
    drive = rng.normal(size=(N - 1, D, 1 + INERTIA + P))
    first = np.zeros((D, C))
    first[:, : D + 6] = rng.normal(size=(D, D + 6))
    observed = rng.normal(size=(N, 6, D))
    information = positive(rng, N, 6)
    information[3] = 0.0
    z, X = rng.normal(size=(N, 6)), rng.normal(size=(N, 6, C - 1))
    affine = np.concatenate([z[:, :, None], -X], axis=2)
    static = np.einsum("kia,kij,kjb->ab", affine, information, affine)
    seen = np.arange(N) != 3
    return Linearised(transition, drive, first, observed, information, information @ affine, static, seen)


def noise_of(case, density, shift):
    rng = np.random.default_rng(1)
    units = np.zeros((N - 1, 2, D, D))
    units[:, 0, :P, :P], units[:, 1, P:, P:] = positive(rng, N - 1, P), positive(rng, N - 1, 6)
    return ProcessNoise(units, np.array(density), np.array(shift))


def dense(case, noise, member):
    """States as affine functions (n, d, c) of θ, their covariance (n, d, d), cost and determinant, all at once."""
    states, covariance = np.zeros((N, D, C)), np.zeros((N, D, N, D))
    states[0] = case.first
    for k in range(N - 1):
        F = case.transition[k]
        states[k + 1] = F @ states[k]
        states[k + 1, :, : 1 + INERTIA + P] += case.drive[k]
        covariance[k + 1, :, : k + 1] = np.einsum("ij,jnk->ink", F, covariance[k, :, : k + 1])
        covariance[: k + 1, :, k + 1] = np.transpose(covariance[k + 1, :, : k + 1], (1, 2, 0))
        Q = np.tensordot(noise.density[member], noise.units[k], 1)
        covariance[k + 1, :, k + 1] = F @ covariance[k, :, k] @ F.T + Q
    flat, P_all = states.reshape(N * D, C), covariance.reshape(N * D, N * D)
    use = np.nonzero(case.seen)[0]
    G, R, y = np.zeros((6 * len(use), N * D)), np.zeros((6 * len(use), 6 * len(use))), np.zeros((6 * len(use), C))
    for row, k in enumerate(use):
        own = slice(6 * row, 6 * row + 6)
        G[own, D * k : D * k + D] = case.observed[k]
        R[own, own] = np.linalg.inv(case.information[k])
        y[own] = np.linalg.solve(case.information[k], case.rhs[k])
        R[own, own][:3, :3] += noise.shift[member] * np.eye(3)
    S, innovation = G @ P_all @ G.T + R, y - G @ flat
    gain = P_all @ G.T @ np.linalg.inv(S)
    after, left = flat + gain @ innovation, P_all - gain @ G @ P_all
    cost = innovation.T @ np.linalg.solve(S, innovation)
    exact = [np.linalg.inv(case.information[k]) for k in use]
    ratio = np.linalg.slogdet(S)[1] - sum(np.linalg.slogdet(one)[1] for one in exact)
    blocks = left.reshape(N, D, N, D)[np.arange(N), :, np.arange(N)]
    return after.reshape(N, D, C), blocks, cost, ratio


@pytest.mark.parametrize("member", [0, 1, 2])
def test_filter_and_smoother_against_conditioning_at_once(case, member):
    noise = noise_of(case, [[0.3, 0.1], [0.0, 0.0], [0.2, 0.0]], [0.0, 0.0, 0.5])
    history = FilterHistory.room(case, 3)
    forward = filtered(case, noise, history)
    states, covariance = smoothed(case, history)
    expected, blocks, cost, ratio = dense(case, noise, member)
    scale = np.abs(cost).max()
    np.testing.assert_allclose(forward.cost[member], cost, atol=1e-9 * scale)
    assert forward.log_determinant[member] == pytest.approx(ratio, abs=1e-8)
    np.testing.assert_allclose(states[:, member], expected, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_allclose(covariance[:, member], blocks, atol=1e-8 * max(np.abs(blocks).max(), 1.0))
    np.testing.assert_allclose(filtered(case, noise).cost, forward.cost)


def test_parameters_and_states_have_their_joint_covariance(case):
    noise = noise_of(case, [[0.3, 0.1]], [0.0])
    prior = Prior(np.linspace(-1, 1, C - 1), 0.2 * np.eye(C - 1))
    (found, parameters), *_ = solve(case, noise, prior)
    states, blocks, cost, ratio = dense(case, noise, 0)
    information = cost[1:, 1:] + 0.2 * np.eye(C - 1)
    theta = np.linalg.solve(information, 0.2 * prior.mean - cost[1:, 0])
    of_theta = np.linalg.inv(information)
    np.testing.assert_allclose(found.theta, theta, rtol=1e-6)
    np.testing.assert_allclose(found.state, states[:, :, 0] + states[:, :, 1:] @ theta, atol=1e-6)
    by = states[:, :, 1:]
    np.testing.assert_allclose(found.of_state, blocks + by @ of_theta @ np.swapaxes(by, 1, 2), atol=1e-6)
    np.testing.assert_allclose(found.crossed, by @ of_theta, atol=1e-6)
    squares = (
        cost[0, 0] + 2 * cost[1:, 0] @ theta + theta @ cost[1:, 1:] @ theta + 0.2 * np.sum((theta - prior.mean) ** 2)
    )
    assert parameters.squares == pytest.approx(squares)
    likelihood = log_likelihoods(case, noise, prior, 10.0, 2.0)[0]
    assert likelihood == pytest.approx(-0.5 * (ratio + np.linalg.slogdet(information)[1] + squares / 2.0))
    free = log_likelihoods(case, noise, prior, 10.0, None)[0]
    assert free == pytest.approx(-0.5 * (ratio + np.linalg.slogdet(information)[1] + 10.0 * np.log(squares)))


def test_a_mixture_has_the_mean_and_covariance_of_its_samples(case):
    noise = noise_of(case, [[0.3, 0.1], [0.0, 0.0]], [0.0, 0.0])
    prior = Prior(np.zeros(C - 1), 0.2 * np.eye(C - 1))
    both = [solution for solution, _ in solve(case, noise, prior)]
    weight, variance = np.array([0.3, 0.7]), np.array([2.0, 0.5])
    found = mixed(both, weight, variance)
    rng = np.random.default_rng(2)
    count = 200_000
    parts = [
        rng.multivariate_normal(one.theta, factor * one.of_theta, int(w * count))
        for one, w, factor in zip(both, weight, variance, strict=True)
    ]
    drawn = np.concatenate(parts)
    deviation = np.sqrt(np.diag(found.of_theta))
    np.testing.assert_allclose(found.theta, drawn.mean(axis=0), atol=0.02 * deviation.max())
    np.testing.assert_allclose(
        found.of_theta / np.outer(deviation, deviation), np.cov(drawn.T) / np.outer(deviation, deviation), atol=0.02
    )


def test_a_member_that_has_lost_the_motion_spoils_no_other():
    """One singular matrix among many makes LAPACK give up all of them."""
    rng = np.random.default_rng(1)
    regular = np.eye(6) + 0.1 * rng.normal(size=(6, 6))
    nearly = np.diag([1.0, 1, 1, 1, 1, 1e-18])
    found = module._inverse(np.stack([regular, np.zeros((6, 6)), np.full((6, 6), np.nan), nearly, 2 * regular]))
    np.testing.assert_allclose(found[0] @ regular, np.eye(6), atol=1e-12)
    np.testing.assert_allclose(found[4], found[0] / 2, atol=1e-12)
    assert np.isnan(found[1:4]).all()
