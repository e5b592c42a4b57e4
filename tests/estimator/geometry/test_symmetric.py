"""Pseudo-inverses, against numpy's."""

import numpy as np
import pytest

from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import inverse_across, null_space_of, symmetric_pseudo_inverse


def test_pseudo_inverse_is_independent_of_scale():
    factor = np.random.default_rng(0).normal(size=(6, 6))
    scale = 10.0 ** np.array([-8, -3, 0, 2, 5, 8])
    matrix = factor @ factor.T * np.outer(scale, scale)
    found = symmetric_pseudo_inverse(matrix) * np.outer(scale, scale)
    np.testing.assert_allclose(found, np.linalg.inv(factor @ factor.T), rtol=1e-7)
    assert null_space_of(matrix).shape == (6, 0)


def test_null_space_is_left_out_and_returned():
    factor = np.random.default_rng(0).normal(size=(6, 3))
    singular = factor @ factor.T
    found, null_space = symmetric_pseudo_inverse(singular), null_space_of(singular)
    np.testing.assert_allclose(singular @ found @ singular, singular, atol=1e-10)
    assert np.linalg.matrix_rank(found, tol=1e-8) == 3
    assert null_space.shape == (6, 3)
    np.testing.assert_allclose(singular @ null_space, 0, atol=1e-6 * np.abs(null_space).max())
    np.testing.assert_array_equal(symmetric_pseudo_inverse(np.zeros((2, 2))), 0)
    assert null_space_of(np.zeros((2, 2))).shape == (2, 2)


def test_rounding_left_by_elimination_belongs_to_the_null_space():
    """A direction whose information was 1e8 before the elimination and is 1e-7 after it: 1e-15 of its size."""
    matrix, sizes = np.diag([1e8, 1e-7]), np.array([1e8, 1e8])
    np.testing.assert_allclose(symmetric_pseudo_inverse(matrix, sizes), np.diag([1e-8, 0]), rtol=1e-12)
    null_space = null_space_of(matrix, sizes)
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
