"""Sums and covariances over blocks against those over all frames, for Jacobians that are waves."""

import numpy as np
import pytest

from baryscope.estimator.ml.jacobians import Jacobians, worthwhile
from baryscope.estimator.paths.blocks import Blocks

TIME = np.sort(np.random.default_rng(0).uniform(10.0, 40.0, 1200))


def waves(time):
    """A Jacobian (n, 3, 4) of frequencies up to 1 rad/s."""
    phase = np.arange(12.0).reshape(3, 4)
    return np.cos(time[:, None, None] * (phase + 1) / 12 + phase)


def test_jacobians_over_blocks_agree_with_all_frames():
    blocks = Blocks.over(TIME, 3.0)
    assert worthwhile(blocks)
    few, every = Jacobians.of(waves, TIME, blocks), Jacobians(waves, TIME, None)
    assert len(blocks.knots) == 10
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    # Of a wave 2 (ωT/4)¹²/12! = 1.3e-10 with ωT = 3; the covariances are of the order of ten, of four columns.
    np.testing.assert_allclose(few.covariances(root @ root.T), every.covariances(root @ root.T), rtol=0, atol=5e-9)
    np.testing.assert_allclose(few.times(root), every.times(root), rtol=0, atol=1e-9)
    factors = rng.normal(size=(1200, 3, 3))
    np.testing.assert_allclose(few.mean(factors), every.mean(factors), rtol=0, atol=1e-10)
    np.testing.assert_allclose(every.mean(factors), np.mean(factors @ waves(TIME), axis=0), atol=1e-12)


@pytest.mark.parametrize(("time", "longest"), [(np.arange(10.0), 1.0), (np.zeros(1), 1.0), (np.arange(3.0), np.inf)])
def test_few_frames_are_not_worth_blocks(time, longest):
    assert not worthwhile(Blocks.over(time, longest))
