"""The blocks of the normal equations, against central differences of the whitened residuals."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.normal_equations import at_best_attitudes, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from synthetic import differences, roots

N, M = 4, 5


def scene(full, seed=0):
    """Random poses and points, observations with errors of 0.1, some weights zero, and precisions if `full`."""
    rng = np.random.default_rng(seed)
    attitude = Rotation.random(N, random_state=seed).as_matrix()
    origin, points = rng.normal(size=(N, 3)) * 5, rng.normal(size=(M, 3)) * 2
    position = origin[:, None] + points @ np.swapaxes(attitude, 1, 2) + 0.1 * rng.normal(size=(N, M, 3))
    weight = rng.uniform(0.3, 2, (N, M)) * (rng.random((N, M)) < 0.8)
    precision = None
    if full:
        factor = rng.normal(size=(N, M, 3, 3))
        precision = factor @ np.swapaxes(factor, 2, 3) + 0.1 * np.eye(3)
    return Observations(np.where(weight[..., None] > 0, position, 0.0), weight, precision), attitude, origin, points


def whitened(observations, attitude, origin, points):
    """Residuals (3 n m,) of unit variance as a function of all unknowns: φ (n, 3), τ (n, 3), δb (m, 3)."""
    root = roots(observations.weight, observations.precision)

    def function(unknowns):
        phi, tau, delta = unknowns[: 3 * N], unknowns[3 * N : 6 * N].reshape(N, 3), unknowns[6 * N :].reshape(M, 3)
        R = attitude @ Rotation.from_rotvec(phi.reshape(N, 3)).as_matrix()
        moved = origin + np.einsum("nij,nj->ni", attitude, tau)
        model = moved[:, None] + (points + delta) @ np.swapaxes(R, 1, 2)
        return (root @ (observations.position - model)[..., None]).ravel()

    return function


@pytest.mark.parametrize("full", [False, True], ids=["isotropic", "precisions"])
def test_pieces_are_the_blocks_of_the_dense_normal_equations(full):
    observations, attitude, origin, points = scene(full)
    function = whitened(observations, attitude, origin, points)
    residual, J = function(np.zeros(6 * N + 3 * M)), differences(function, np.zeros(6 * N + 3 * M))
    matrix, rhs = J.T @ J, -J.T @ residual
    found = normal_blocks(observations, attitude, origin, points)
    turns, shifts, rest = np.arange(3 * N), np.arange(3 * N, 6 * N), np.arange(6 * N, 6 * N + 3 * M)
    exact = {"rtol": 0, "atol": 1e-8 * np.abs(matrix).max()}  # of central differences with steps of 1e-6
    for k in range(N):
        turn, shift = turns[3 * k : 3 * k + 3], shifts[3 * k : 3 * k + 3]
        np.testing.assert_allclose(found.turn[k], matrix[np.ix_(turn, turn)], **exact)
        np.testing.assert_allclose(found.turn_shift[k], matrix[np.ix_(turn, shift)], **exact)
        np.testing.assert_allclose(found.shift[k], matrix[np.ix_(shift, shift)], **exact)
        np.testing.assert_allclose(found.turn_points()[k], matrix[np.ix_(turn, rest)], **exact)
    for index in range(M):
        own = rest[3 * index : 3 * index + 3]
        np.testing.assert_allclose(found.point[index], matrix[np.ix_(own, own)], **exact)
    np.testing.assert_allclose(found.turn_rhs.ravel(), rhs[turns], **exact)
    np.testing.assert_allclose(found.shift_rhs.ravel(), rhs[shifts], **exact)
    np.testing.assert_allclose(found.point_rhs.ravel(), rhs[rest], **exact)
    np.testing.assert_allclose(found.squares, (residual.reshape(N, M, 3) ** 2).sum(axis=2), rtol=1e-12, atol=1e-15)
    # Unknowns that change all poses.
    rng = np.random.default_rng(1)
    turn, shift = rng.normal(size=(N, 3, 7)), rng.normal(size=(N, 3, 7))
    by_turn, by_shift = turn.reshape(-1, 7).T @ matrix[np.ix_(turns, rest)], shift.reshape(-1, 7).T
    by_shift = by_shift @ matrix[np.ix_(shifts, rest)]
    exact["atol"] *= 10
    np.testing.assert_allclose(found.unknowns_points(turn, shift), by_turn + by_shift, **exact)
    np.testing.assert_allclose(found.unknowns_points(None, shift), by_shift, **exact)


def test_isotropic_weights_agree_with_precisions_that_are_multiples_of_the_identity():
    observations, attitude, origin, points = scene(full=False)
    same = Observations(observations.position, observations.weight, np.broadcast_to(np.eye(3), (N, M, 3, 3)))
    one, two = (normal_blocks(s, attitude, origin, points) for s in (observations, same))
    for name in ("turn", "turn_shift", "shift", "point", "turn_rhs", "shift_rhs", "point_rhs", "squares"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(one.turn_points(), two.turn_points(), atol=1e-12)


def test_subsets_and_weights_of_observations():
    observations, *_ = scene(full=True)
    part = observations.frames(slice(1, 3)).features(np.array([4, 0]))
    np.testing.assert_array_equal(part.position, observations.position[1:3][:, [4, 0]])
    np.testing.assert_array_equal(part.weight, observations.weight[1:3][:, [4, 0]])
    np.testing.assert_array_equal(part.precision, observations.precision[1:3][:, [4, 0]])
    assert observations.count == (observations.weight > 0).sum()
    heavier = observations.weighted(2 * observations.weight)
    np.testing.assert_array_equal(heavier.weight, 2 * observations.weight)
    residual = np.random.default_rng(0).normal(size=(N, M, 3))
    expected = [[residual[k, i] @ observations.precision[k, i] @ residual[k, i] for i in range(M)] for k in range(N)]
    np.testing.assert_allclose(heavier.squares(residual), expected, rtol=1e-12)
    plain, *_ = scene(full=False)
    np.testing.assert_allclose(plain.squares(residual), np.linalg.norm(residual, axis=2) ** 2, rtol=1e-12)


def test_cross_matrices_agree_with_numpy():
    a, b = np.random.default_rng(0).normal(size=(2, 6, 3))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", cross_matrices(a), b), np.cross(a, b), atol=1e-15)


def test_inverses_by_cofactors_and_zero_for_singular_matrices():
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(200, 3, 3)) * 10 ** rng.uniform(-6, 6, (200, 1, 1))
    matrix = factor @ np.swapaxes(factor, 1, 2)
    well_conditioned = np.linalg.cond(matrix) < 1e6
    assert well_conditioned.sum() > 150
    product = symmetric_inverses(matrix)[well_conditioned] @ matrix[well_conditioned]
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-8)
    a, b = rng.normal(size=(2, 3))
    singular = np.stack([np.outer(a, a), np.outer(a, a) + np.outer(b, b), np.zeros((3, 3))])
    np.testing.assert_array_equal(symmetric_inverses(singular), 0)


@pytest.mark.parametrize("full", [False, True])
def test_best_attitudes_agree_with_scipys_alignment(full):
    """The steps converge to the solution of Wahba's problem; with precisions, to a stationary point."""
    observations, attitude, origin, points = scene(full)
    for _ in range(40):
        attitude, found = at_best_attitudes(observations, attitude, origin, points)
    np.testing.assert_allclose(found.turn_rhs, 0.0, atol=1e-9 * np.abs(found.turn).max())
    if not full:
        for k in range(N):
            expected, _ = Rotation.align_vectors(observations.position[k] - origin[k], points, observations.weight[k])
            np.testing.assert_allclose(attitude[k], expected.as_matrix(), atol=1e-9)
    function = whitened(observations, attitude, origin, points)
    slope = differences(
        lambda phi: np.sum(function(np.append(phi, np.zeros(3 * N + 3 * M))) ** 2)[None], np.zeros(3 * N)
    )
    np.testing.assert_allclose(slope, 0.0, atol=1e-5)


def test_frames_that_follow_each_other_are_a_view():
    observations, *_ = scene(full=True)
    assert np.shares_memory(observations.frames(np.array([1, 2])).position, observations.position)
    np.testing.assert_array_equal(observations.features(np.array([1, 2])).precision, observations.precision[:, 1:3])
