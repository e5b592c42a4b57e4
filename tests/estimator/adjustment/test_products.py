"""Products of errors: their patterns against the covariance of products of independent Gaussian errors."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.products import MODES, are_negligible, independent, product_shifts
from baryscope.estimator.geometry.so3 import cross_matrices


def positive(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T


def test_independent_combinations_have_the_covariance():
    """Of unknowns in units a million apart: L Lᵀ = C, and L⁻ᵀ turns C into L."""
    scale = np.diag([1e-6, 1.0, 1e3])
    covariance = scale @ positive(np.random.default_rng(0), 3) @ scale
    root, inverse = independent(covariance)
    size = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(root @ root.T / np.outer(size, size), covariance / np.outer(size, size), atol=1e-12)
    np.testing.assert_allclose(covariance @ inverse / size[:, None], root / size[:, None], atol=1e-9)


def test_patterns_have_the_covariance_of_products():
    """E[(φ × δ)(φ × δ)ᵀ] = Σ Pᵢⱼ [eᵢ]× C [eⱼ]×ᵀ at each frame, C the covariance of φ less its mean over seen frames."""
    rng = np.random.default_rng(1)
    turns, offset = 1e-3 * rng.normal(size=(20, 3, MODES)), positive(rng, 3)
    seen = np.arange(20) % 3 > 0
    found = product_shifts(turns, offset, 1e-9 * np.broadcast_to(np.eye(3), (20, 3, 3)), seen)
    own = turns - turns[seen].mean(axis=0)
    axes = cross_matrices(np.eye(3))
    expected = np.einsum("ij,iab,nbr,ncr,jdc->nad", offset, axes, own, own, axes)
    np.testing.assert_allclose(found @ np.swapaxes(found, 1, 2), expected, rtol=1e-9, atol=1e-18)


@pytest.mark.parametrize(("deviation", "patterns"), [(1e-6, 6), (1.0, 0)])
def test_patterns_that_the_position_hides_are_left_out(deviation, patterns):
    """Products of a milliradian and a metre: a millimetre."""
    rng = np.random.default_rng(2)
    turns = 1e-3 * rng.normal(size=(10, 3, 2))
    position = np.broadcast_to(deviation**2 * np.eye(3), (10, 3, 3))
    assert product_shifts(turns, np.eye(3), position).shape[2] == patterns


def test_negligible_products_have_no_patterns():
    """Whatever the deviation of the position and its ellipsoids."""
    rng = np.random.default_rng(3)
    turns, offset = 1e-3 * rng.normal(size=(10, 3, 2)), positive(rng, 3)
    own = turns - turns.mean(axis=0)
    shape = np.array([positive(rng, 3) + 0.1 * np.eye(3) for _ in range(10)])
    shape /= np.linalg.eigvalsh(shape)[:, 0].min()
    deviations = np.geomspace(1e-5, 1.0, 40)
    patterns = [product_shifts(turns, offset, size**2 * shape).shape[2] > 0 for size in deviations]
    known = [are_negligible(own @ np.swapaxes(own, 1, 2), offset, size**2 * shape) for size in deviations]
    assert not any(negligible and some for negligible, some in zip(known, patterns, strict=True))
    assert known[-1]
    assert not known[0]
    assert not are_negligible(own @ np.swapaxes(own, 1, 2), offset, np.zeros((10, 3, 3)))


@pytest.mark.parametrize(("offset_axis", "negligible"), [(2, True), (0, False)])
def test_products_along_one_axis_are_none(offset_axis, negligible):
    """φ × δ is zero where both are along z, whatever their sizes, and a metre where one radian is across one metre."""
    turns = np.zeros((10, 3, 3))
    turns[:, 2, 2] = 1.0
    offset = np.diag(np.eye(3)[offset_axis])
    assert are_negligible(turns, offset, np.tile(1e-4 * np.eye(3), (10, 1, 1))) == negligible
