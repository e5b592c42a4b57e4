"""Blocks of time in which functions are polynomials: sums over many frames become sums over few knots.

In a block a function is the polynomial of degree KNOTS − 1 through its values at Chebyshev's points, its knots. So
Σ Jᵀ W J over the frames of a block needs of the weights W only the sums with products of two interpolation weights,
and neither time nor memory for a Jacobian J of every frame. The error of a wave of phase φ = ω T in a block of length T
is 2 (φ/4)^KNOTS / KNOTS! of it (Trefethen, Approximation Theory and Approximation Practice, ch. 8).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import FULL, elements_of
from baryscope.estimator.paths.polynomials import lagrange_weights
from baryscope.estimator.paths.sampled_path import Frames

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

KNOTS = 12  # of a block
FEWEST = 1000  # frames, from which it is worth while to look at knots instead
NODES = -np.cos(np.pi * (np.arange(KNOTS) + 0.5) / KNOTS)  # Chebyshev's points of −1 … 1
ROW, COLUMN = np.triu_indices(KNOTS)  # of the pairs of knots
PAIRS = len(ROW)
PAIR = np.zeros((KNOTS, KNOTS), dtype=np.intp)
PAIR[ROW, COLUMN] = PAIR[COLUMN, ROW] = np.arange(PAIRS)
SHORTEST = 1e-9  # s, of a block
PART = 2000  # frames whose covariances are computed together, about


@dataclass(frozen=True, eq=False)
class Blocks:
    """k blocks that n frames lie in: their knots (k, KNOTS) in s, ascending, and the weights (n, KNOTS) of the frames.

    The value at a frame is the sum of its weights times the values at the knots of its block; block j has the frames
    first[j] to first[j + 1], first (k + 1,).
    """

    knots: FloatArray
    first: IntArray
    weights: FloatArray

    @classmethod
    def over(cls, time: FloatArray, longest: float) -> "Blocks":
        """Blocks of at most `longest` s, equally long, over ascending times (n,) in s, but those without frames."""
        span = float(time[-1] - time[0])
        count = int(np.clip(np.ceil(span / longest), 1, len(time))) if longest > 0 else len(time)
        length = max(span / count, SHORTEST)
        index = np.minimum(((time - time[0]) / length).astype(np.intp), count - 1)
        first = np.flatnonzero(np.diff(index, prepend=-1))
        middle = time[0] + (index + 0.5) * length
        weights = lagrange_weights(NODES, (time - middle) / (length / 2))
        return cls(middle[first, None] + length / 2 * NODES, np.append(first, len(time)), weights)

    def of(self, frames: IntArray) -> "Blocks":
        """The blocks with some of the frames only, by their ascending indices (f,)."""
        return Blocks(self.knots, np.searchsorted(frames, self.first), self.weights[frames])

    def around(self, frames: Frames) -> tuple[slice, IntArray]:
        """Which blocks hold the ascending frames, and where in `frames` each of them begins, with the end of the last.

        Blocks between the first and the last may hold none.
        """
        if isinstance(frames, slice):
            begin, end, _ = frames.indices(len(self.weights))
            if begin >= end:
                return slice(0, 0), np.zeros(1, dtype=np.intp)
            of_ends = np.searchsorted(self.first, [begin, end - 1], side="right").tolist()
            held = slice(of_ends[0] - 1, of_ends[1])
            return held, np.clip(self.first[held.start : held.stop + 1], begin, end) - begin
        bounds = np.searchsorted(frames, self.first)
        some = np.flatnonzero(np.diff(bounds))
        held = slice(int(some[0]), int(some[-1]) + 1) if some.size else slice(0, 0)
        return held, bounds[held.start : held.stop + 1]

    def at_frames(self, values: FloatArray) -> FloatArray:
        """The values (n, ...) at the frames of values (k KNOTS, ...) at the knots."""
        by_block = values.reshape(len(self.knots), KNOTS, -1)
        found = np.empty((len(self.weights), by_block.shape[2]))
        for own, (begin, end) in zip(by_block, pairwise(self.first.tolist()), strict=True):
            np.matmul(self.weights[begin:end], own, out=found[begin:end])
        return found.reshape(len(found), *values.shape[1:])

    def covariances(self, jacobian: FloatArray, covariance: FloatArray) -> FloatArray:
        """J C Jᵀ (n, 3, 3) at the frames for a Jacobian (k KNOTS, 3, q) at the knots and a covariance C (q, q)."""
        found = np.empty((len(self.weights), 6))
        by_block = jacobian.reshape(len(self.knots), 3 * KNOTS, -1)
        for blocks in self._parts():
            own = by_block[blocks]
            left = (own.reshape(-1, own.shape[2]) @ covariance).reshape(own.shape)
            joint = (left @ np.swapaxes(own, 1, 2)).reshape(-1, KNOTS, 3, KNOTS, 3).transpose(0, 1, 3, 2, 4)
            of_pairs = elements_of(joint[:, ROW, COLUMN] + joint[:, COLUMN, ROW])
            of_pairs[:, ROW == COLUMN] /= 2
            bounds = self.first[blocks.start : blocks.stop + 1]
            pairs = _pairs(self.weights[bounds[0] : bounds[-1]])
            for both, (begin, end) in zip(of_pairs, pairwise(bounds.tolist()), strict=True):
                np.matmul(pairs[:, begin - bounds[0] : end - bounds[0]].T, both, out=found[begin:end])
        return found[:, FULL]

    def squares(self) -> FloatArray:
        """Σ w wᵀ (k, KNOTS, KNOTS) over the frames of each block."""
        bounds = pairwise(self.first.tolist())
        return np.array([self.weights[begin:end].T @ self.weights[begin:end] for begin, end in bounds])

    def _parts(self) -> Iterator[slice]:
        """Parts of the blocks of about PART frames."""
        cuts = np.unique(np.searchsorted(self.first, np.arange(0, len(self.weights), PART), side="right") - 1)
        return (slice(begin, end) for begin, end in pairwise([*cuts.tolist(), len(self.knots)]))

    def sums(self, frames: Frames, values: FloatArray) -> FloatArray:
        """Σ w v (b, ..., KNOTS, c) over f ascending frames in each of the blocks around them, for v (..., f, c)."""
        return self._summed(frames, self.weights[frames].T, values)

    def pair_sums(self, frames: Frames, values: FloatArray, *places: IntArray) -> list[FloatArray]:
        """Σ w wᵀ ⊗ V (b, r KNOTS, s KNOTS) likewise, for matrices V (f, r, s) of columns of values (f, c).

        places (r, s), of one or several V: the column that is an element. Rows and columns are those of V for the first
        knot, then for the second, and so on.
        """
        found = self._summed(frames, _pairs(self.weights[frames]), values)
        columns = values.shape[1]
        flat = found.reshape(len(found), PAIRS * columns)
        all_places = (columns * PAIR[:, None, :, None] + own[:, None] for own in places)
        return [flat[:, own.reshape(KNOTS * own.shape[1], -1)] for own in all_places]

    def _summed(self, frames: Frames, weights: FloatArray, values: FloatArray) -> FloatArray:
        held, bounds = self.around(frames)
        found = np.empty((held.stop - held.start, *values.shape[:-2], len(weights), values.shape[-1]))
        for own, (begin, end) in zip(found, pairwise(bounds.tolist()), strict=True):
            np.matmul(weights[:, begin:end], values[..., begin:end, :], out=own)
        return found


def _pairs(weights: FloatArray) -> FloatArray:
    """The products (pairs, n) of two of the weights (n, KNOTS)."""
    across, found, first = weights.T, np.empty((PAIRS, len(weights))), 0
    for k in range(KNOTS):
        last = first + KNOTS - k
        np.multiply(across[k], across[k:], out=found[first:last])
        first = last
    return found
