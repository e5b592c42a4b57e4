"""Sums over blocks of frames, of functions that are polynomials within them, against those over every frame."""

import numpy as np
import pytest

from baryscope.estimator.paths.blocks import KNOTS, Blocks

TIME = np.sort(np.random.default_rng(0).uniform(10.0, 40.0, 300))
BLOCKS = Blocks.over(TIME, 7.0)


def polynomials(time):
    """Values (n, 3, 4) of polynomials of degree KNOTS − 1 in time."""
    scaled = (time - 25.0) / 15.0
    coefficients = np.random.default_rng(1).normal(size=(KNOTS, 12))
    return np.polynomial.chebyshev.chebval(scaled, coefficients).T.reshape(-1, 3, 4)


AT_KNOTS, AT_FRAMES = polynomials(BLOCKS.knots.ravel()), polynomials(TIME)


def test_polynomials_are_exact():
    np.testing.assert_allclose(BLOCKS.at_frames(AT_KNOTS), AT_FRAMES, atol=1e-11)
    root = np.random.default_rng(2).normal(size=(4, 4))
    found = BLOCKS.covariances(AT_KNOTS, root @ root.T)
    np.testing.assert_allclose(found, AT_FRAMES @ root @ root.T @ np.swapaxes(AT_FRAMES, 1, 2), atol=1e-10)


@pytest.mark.parametrize("frames", [slice(0, 300), slice(20, 110), np.array([5, 6, 200, 299]), np.arange(150, 150)])
def test_sums_are_those_over_the_frames(frames):
    held = BLOCKS.around(frames)[0]
    own, knots = AT_FRAMES[frames], AT_KNOTS.reshape(-1, KNOTS, 3, 4)[held]
    values = np.random.default_rng(3).normal(size=(2, len(own), 1))
    expected = np.einsum("npq,snc->spqc", own, values)
    found = np.einsum("bkpq,bskc->spqc", knots, BLOCKS.sums(frames, values))
    np.testing.assert_allclose(found, expected, atol=1e-10)
    matrices, places = np.random.default_rng(4).normal(size=(len(own), 7)), np.array([[0, 3, 1], [6, 2, 4]])
    products = np.einsum("npi,npq,nqj->ij", own[:, :2], matrices[:, places], own)
    both = BLOCKS.pair_sums(frames, matrices, places, places.T)
    for found, left, right in zip(both, (knots[:, :, :2], knots), (knots, knots[:, :, :2]), strict=True):
        by_knot = found.reshape(-1, KNOTS, left.shape[2], KNOTS, right.shape[2])
        summed = np.einsum("bkpi,bkplq,blqj->ij", left, by_knot, right)
        np.testing.assert_allclose(summed, products if left is not knots else products.T, atol=1e-9)


def test_gaps_have_no_blocks():
    time = np.concatenate([np.linspace(0.0, 9.0, 100), np.linspace(91.0, 100.0, 100)])
    blocks = Blocks.over(time, 5.0)
    assert len(blocks.knots) == 4
    assert blocks.knots.min() > 0.0
    of_frame = np.repeat(np.arange(4), np.diff(blocks.first))
    np.testing.assert_array_equal(of_frame, np.searchsorted([5.0, 90.0, 95.0], time, side="right"))
    np.testing.assert_allclose(blocks.at_frames(blocks.knots.ravel()), time, atol=1e-12)


@pytest.mark.parametrize(("time", "longest", "count"), [(TIME, 0.0, 300), (np.zeros(1), 1.0, 1), (TIME, np.inf, 1)])
def test_there_are_at_most_as_many_blocks_as_frames(time, longest, count):
    assert 1 <= len(Blocks.over(time, longest).knots) <= count
