"""Pseudo-inverses, against numpy's."""

import numpy as np
import pytest

from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import (
    eigen,
    inverse_across,
    inverse_and_null_space,
    inverted_sums,
    made_definite,
    symmetric_pseudo_inverse,
)


def test_pseudo_inverse_is_independent_of_scale():
    factor = np.random.default_rng(0).normal(size=(6, 6))
    scale = 10.0 ** np.array([-8, -3, 0, 2, 5, 8])
    matrix = factor @ factor.T * np.outer(scale, scale)
    found = symmetric_pseudo_inverse(matrix) * np.outer(scale, scale)
    np.testing.assert_allclose(found, np.linalg.inv(factor @ factor.T), rtol=1e-7)
    assert inverse_and_null_space(matrix)[1].shape == (6, 0)


def test_inverted_sums_of_regular_and_of_singular_matrices():
    """Of a singular A as of one that is nearly so."""
    factors = np.random.default_rng(3).normal(size=(2, 50, 3, 3))
    A, B = factors @ np.swapaxes(factors, 2, 3) + 0.1 * np.eye(3)
    np.testing.assert_allclose(inverted_sums(A, B), np.linalg.inv(np.linalg.inv(A) + B), rtol=1e-9, atol=1e-12)
    flat, thin = (np.linalg.qr(factors[0])[0] * [1.0, 2.0, least] for least in (0.0, 1e-4))
    nearly = np.linalg.inv(np.linalg.inv(thin @ np.swapaxes(thin, 1, 2)) + B)
    np.testing.assert_allclose(inverted_sums(flat @ np.swapaxes(flat, 1, 2), B), nearly, atol=1e-6)
    np.testing.assert_array_equal(inverted_sums(np.zeros((1, 3, 3)), B[:1]), 0)
    np.testing.assert_allclose(inverted_sums(A[:1], np.zeros((1, 3, 3))), A[:1], rtol=1e-12)


def test_inverted_sums_are_covariances_however_great_the_information_is():
    """Of two directions, of 26 digits more than the covariance: by rounding A (1 + B A)⁻¹ is indefinite, or there is
    none."""
    factors = np.random.default_rng(4).normal(size=(2, 200, 3, 3))
    A = factors[0] @ np.swapaxes(factors[0], 1, 2)
    columns = 1e13 * factors[1][:, :, :2]
    found = inverted_sums(A, columns @ np.swapaxes(columns, 1, 2))
    assert (np.linalg.eigvalsh(found) >= -1e-15 * np.trace(found, axis1=1, axis2=2)[:, None]).all()
    assert (np.linalg.eigvalsh(A - found) >= -1e-14 * np.trace(A, axis1=1, axis2=2)[:, None]).all()


def test_null_space_is_left_out_and_returned():
    factor = np.random.default_rng(0).normal(size=(6, 3))
    singular = factor @ factor.T
    found, null_space = inverse_and_null_space(singular)
    np.testing.assert_allclose(singular @ found @ singular, singular, atol=1e-10)
    assert np.linalg.matrix_rank(found, tol=1e-8) == 3
    assert null_space.shape == (6, 3)
    np.testing.assert_allclose(singular @ null_space, 0, atol=1e-6 * np.abs(null_space).max())
    np.testing.assert_array_equal(symmetric_pseudo_inverse(np.zeros((2, 2))), 0)
    assert inverse_and_null_space(np.zeros((2, 2)))[1].shape == (2, 2)


@pytest.mark.parametrize("least", [1e-2, 1e-8, 1e-11, 1e-12])
def test_small_eigenvalues_are_inverted_as_well(least):
    """By Cholesky's factor, or by eigenvalues where the null space might not be empty."""
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(7, 7)))
    values = np.array([1.0, 1.1, 1.2, 1.3, 1.5, 2.0, least])
    matrix = (axes * values) @ axes.T
    found = symmetric_pseudo_inverse((matrix + matrix.T) / 2)
    np.testing.assert_allclose(matrix @ found, np.eye(7), rtol=0, atol=20 * np.finfo(float).eps / least)
    assert inverse_and_null_space(matrix)[1].shape == (7, 0)


def test_rounding_left_by_elimination_belongs_to_the_null_space():
    """A direction whose information was 1e8 before the elimination and is 1e-7 after it: 1e-15 of its size."""
    matrix, sizes = np.diag([1e8, 1e-7]), np.array([1e8, 1e8])
    np.testing.assert_allclose(symmetric_pseudo_inverse(matrix, sizes), np.diag([1e-8, 0]), rtol=1e-12)
    null_space = inverse_and_null_space(matrix, sizes)[1]
    assert null_space.shape == (2, 1)
    assert null_space[0, 0] == 0
    np.testing.assert_allclose(symmetric_pseudo_inverse(matrix), np.diag([1e-8, 1e7]), rtol=1e-12)


@pytest.mark.parametrize("ratio", [1.0, 1e-5, 1e-10])
def test_an_inverse_across_rotations_holds_for_points_of_any_weights(ratio):
    """W − W T (Tᵀ W T)⁻¹ Tᵀ W is singular along T, and W⁻¹ inverts it across: with no change along T it is P W⁻¹ P."""
    points = np.random.default_rng(5).uniform(-1, 1, (6, 3))
    weight = np.repeat([1.0, 2.0, 1.0, 3.0, 1.0, ratio], 3)
    turns = np.swapaxes(cross_matrices(points), 1, 2).reshape(-1, 3)
    root = np.sqrt(weight)
    whitened, _ = np.linalg.qr(root[:, None] * turns)
    matrix = np.outer(root, root) * (np.eye(18) - whitened @ whitened.T)
    along, _ = np.linalg.qr(turns)
    across = np.eye(18) - along @ along.T
    exact = across @ np.diag(1 / weight) @ across
    found = inverse_across(matrix, turns, weight)
    size = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(found / np.outer(size, size), exact / np.outer(size, size), atol=1e-9)


@pytest.mark.parametrize("lost", [0.0, 1e-16, 1e-13, 1e-9])
def test_covariances_that_rounding_leaves_indefinite_are_wider_by_what_it_lost(lost):
    """lost: an eigenvalue below zero over the trace, as of large terms that cancel."""
    axes = np.linalg.qr(np.random.default_rng(6).normal(size=(200, 3, 3)))[0]
    size = 10.0 ** np.random.default_rng(7).uniform(-6, 18, 200)
    given = (axes * np.array([1.0, 0.3, -lost])) @ np.swapaxes(axes, 1, 2) * size[:, None, None]
    found = made_definite((given + np.swapaxes(given, 1, 2)) / 2)
    assert (np.linalg.eigvalsh(found)[:, 0] > 0).all()
    np.linalg.cholesky(found)
    assert (np.abs(found - given).max(axis=(1, 2)) < (2 * lost + 2e-14) * size).all()


def test_covariances_that_are_definite_stay_as_they_are():
    given = np.array([np.diag([1e6, 1.0, 1e-6]), np.eye(3)])
    assert made_definite(given) is given


def test_where_divide_and_conquer_fails_qr_iterations_do(monkeypatch):
    """An `ekf` of the second population, seed 5, case 71, ended in a LinAlgError of a matrix that has no fault."""
    rng = np.random.default_rng(1)
    axes, _ = np.linalg.qr(rng.standard_normal((5, 5)))
    matrix = (axes * np.array([1e-9, 0.5, 1.0, 2.0, 7.0])) @ axes.T

    def fails(_):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr(np.linalg, "eigh", fails)
    values, vectors = eigen(matrix)
    np.testing.assert_allclose(values, [1e-9, 0.5, 1.0, 2.0, 7.0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose((vectors * values) @ vectors.T, matrix, atol=1e-13)
