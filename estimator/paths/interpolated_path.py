"""A path at many times, interpolated between few."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import FULL, elements_of
from baryscope.estimator.paths.blocks import FEWEST, KNOTS, Blocks
from baryscope.estimator.paths.sampled_path import Frames, IsotropicPath, SampledPath, product

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

PHASE = 1.8  # rad of the highest frequency in a block: an error of 3e-13, and of 1e-9 of a wave of twice that frequency
WORTHWHILE = 2  # frames of a knot, on average, from which interpolation is faster
WORTHWHILE_IN_AXES = 8  # for a path that is the same in three axes


class InterpolatedPath(SampledPath):
    """A path at the frames of blocks, from itself at their knots."""

    def __init__(self, blocks: Blocks, at_knots: SampledPath) -> None:
        object.__setattr__(self, "blocks", blocks)
        object.__setattr__(self, "at_knots", at_knots)
        object.__setattr__(self, "position", lambda x: blocks.at_frames(at_knots.position(x)))
        object.__setattr__(self, "seen_of", None)
        object.__setattr__(self, "turn", None)

    blocks: Blocks
    at_knots: SampledPath

    @cached_property
    def jacobian(self) -> FloatArray:
        """The Jacobian (n, 3, p) at the frames."""
        return self.blocks.at_frames(self.at_knots.jacobian)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.at_knots.size

    @cached_property
    def _by_block(self) -> FloatArray:
        """The Jacobian (k, 3 KNOTS, p) at the knots of each block."""
        return self.at_knots.jacobian.reshape(-1, 3 * KNOTS, self.size)

    def gram(self, frames: Frames, weights: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        jacobian, (weighted,) = self._weighted(frames, weights)
        return np.asarray(jacobian.T @ weighted)

    def gram_and_diagonal(
        self, frames: Frames, weights: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `SampledPath`."""
        jacobian, (first, second) = self._weighted(frames, weights, others)
        return np.asarray(jacobian.T @ first), np.asarray(np.einsum("kp,kp->p", jacobian, second))

    def mean_square(self) -> FloatArray:
        """See `SampledPath`."""
        jacobian = self._by_block.reshape(-1, KNOTS, 3 * self.size)
        weighted = self._mean_squares @ jacobian
        return np.asarray(jacobian.reshape(-1, self.size).T @ weighted.reshape(-1, self.size))

    def _weighted(self, frames: Frames, *weights: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """J (3 b KNOTS, p) at the knots of b blocks around the frames, and Σ W J for each of the weights (k, 3, 3)."""
        jacobian = self._by_block[self.blocks.around(frames)[0]]
        elements = np.concatenate([elements_of(one) for one in weights], axis=1)
        places = (FULL + 6 * index for index in range(len(weights)))
        by_pair = self.blocks.pair_sums(frames, elements, *places)
        return jacobian.reshape(-1, self.size), [(own @ jacobian).reshape(-1, self.size) for own in by_pair]

    @property
    def frames(self) -> int:
        """The number of times n."""
        return len(self.blocks.weights)

    def frames_at(self, index: IntArray) -> "InterpolatedPath":
        """See `SampledPath`."""
        return InterpolatedPath(self.blocks.of(index), self.at_knots)

    def moment(self, frames: Frames, values: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        jacobian = self._by_block[self.blocks.around(frames)[0]]
        *lead, _, _, columns = values.shape
        sums = self.blocks.sums(frames, values.reshape(*lead, -1, 3 * columns))
        return product(jacobian.reshape(-1, self.size), np.moveaxis(sums, 0, -3).reshape(*lead, -1, columns))

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        return self.blocks.covariances(self.at_knots.jacobian, of_x)

    def times(self, columns: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        return self.blocks.at_frames(self.at_knots.times(columns))

    def lengths(self, directions: FloatArray) -> FloatArray:
        """See `SampledPath`."""
        moves = (self._by_block @ directions).reshape(len(self.blocks.knots), KNOTS, -1)
        squares = np.sum(moves * (self._mean_squares @ moves), axis=(0, 1)).reshape(3, -1).sum(axis=0)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    @cached_property
    def _mean_squares(self) -> FloatArray:
        """The sums (b, KNOTS, KNOTS) of products of two weights in each block, over the number of all frames."""
        return self.blocks.squares() / self.frames


def interpolated(at: Callable[[FloatArray], SampledPath], frequency: float, time: FloatArray) -> SampledPath:
    """A path at ascending times (n,) in s: interpolated where they are many for its highest frequency in rad/s.

    at: gives it sampled at times, such as `Path.at` and `Path.rate_at` do.
    """
    span = float(time[-1] - time[0])
    count = max(span * frequency / PHASE, 1.0)
    if not max(FEWEST, WORTHWHILE * KNOTS * count) <= len(time) or span <= 0:
        return at(time)
    blocks = Blocks.over(time, span / np.ceil(count))
    at_knots = at(blocks.knots.ravel())
    if isinstance(at_knots, IsotropicPath) and len(time) < WORTHWHILE_IN_AXES * KNOTS * count:
        return at(time)
    return InterpolatedPath(blocks, at_knots)
