"""Pseudo-inverses, against numpy's."""

import numpy as np

from baryscope.estimator.geometry.symmetric import null_space_of, symmetric_pseudo_inverse


def test_any_scale_is_borne():
    factor = np.random.default_rng(0).normal(size=(6, 6))
    scale = 10.0 ** np.array([-8, -3, 0, 2, 5, 8])
    matrix = factor @ factor.T * np.outer(scale, scale)
    found = symmetric_pseudo_inverse(matrix) * np.outer(scale, scale)
    np.testing.assert_allclose(found, np.linalg.inv(factor @ factor.T), rtol=1e-7)
    assert null_space_of(matrix).shape == (6, 0)


def test_what_is_not_seen_is_left_out_and_named():
    low = np.random.default_rng(0).normal(size=(6, 3))
    flat = low @ low.T
    found, blind = symmetric_pseudo_inverse(flat), null_space_of(flat)
    np.testing.assert_allclose(flat @ found @ flat, flat, atol=1e-10)
    assert np.linalg.matrix_rank(found, tol=1e-8) == 3
    assert blind.shape == (6, 3)
    np.testing.assert_allclose(flat @ blind, 0, atol=1e-6 * np.abs(blind).max())
    np.testing.assert_array_equal(symmetric_pseudo_inverse(np.zeros((2, 2))), 0)
    assert null_space_of(np.zeros((2, 2))).shape == (2, 2)


def test_rounding_that_elimination_leaves_is_not_seen():
    """A direction whose information was 1e8 and is 1e-7 now: 1e-15 of what it was."""
    matrix, sizes = np.diag([1e8, 1e-7]), np.array([1e8, 1e8])
    np.testing.assert_allclose(symmetric_pseudo_inverse(matrix, sizes), np.diag([1e-8, 0]), rtol=1e-12)
    blind = null_space_of(matrix, sizes)
    assert blind.shape == (2, 1)
    assert blind[0, 0] == 0
    np.testing.assert_allclose(symmetric_pseudo_inverse(matrix), np.diag([1e-8, 1e7]), rtol=1e-12)
