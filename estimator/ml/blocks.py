"""Blocks of time in which the Jacobians of rotation and path are cubics: four times of a block stand for many frames.

The sum over frames Σ Jᵀ B J, with Jacobians J (6, q) that are cubics in a block, is a sum over blocks: of the frames'
6 × 6 matrices B only the sums with products of the cubics' weights are needed. So the cost of q² is that of the blocks.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.interpolation import lagrange_weights
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.rotation import Attitudes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

KNOTS = 4  # times of a block, Chebyshev's: the error of a wave is 3e-4 (ωT)⁴ of it, T the block's length
WORTHWHILE = 2 * KNOTS  # frames of a block, on average, from which sums over blocks are faster
PART = 256  # frames whose Jacobians are evaluated together
SHORTEST = 1e-9  # s, of a block


@dataclass(frozen=True, eq=False)
class Blocks:
    """k blocks of n frames: the first frame (k,) of each, and its times (k, KNOTS) in s.

    weights (n, KNOTS): the value of a cubic at a frame is the sum of these times its values at the times of the block.
    """

    first: IntArray
    time: FloatArray
    weights: FloatArray

    @property
    def worthwhile(self) -> bool:
        """Whether sums over blocks are faster than those over frames."""
        return len(self.weights) >= WORTHWHILE * len(self.first)

    @cached_property
    def of_frame(self) -> IntArray:
        """The index (n,) of each frame's block."""
        return np.repeat(np.arange(len(self.first)), np.diff(self.first, append=len(self.weights)))


def blocks_of(time: FloatArray, longest: float) -> Blocks:
    """Blocks of at most `longest` seconds of ascending times (n,) in s."""
    span = float(time[-1] - time[0])
    count = max(min(int(np.ceil(span / longest)), len(time)), 1) if longest > 0 else 1
    length = max(span / count, SHORTEST)
    index = np.minimum(((time - time[0]) / length).astype(np.intp), count - 1)
    first = np.nonzero(np.diff(index, prepend=-1))[0]
    nodes = -np.cos(np.pi * (np.arange(KNOTS) + 0.5) / KNOTS)
    middle = time[0] + (index[first] + 0.5) * length
    own = (time - (time[0] + (index + 0.5) * length)) / (length / 2)
    return Blocks(first, middle[:, None] + length / 2 * nodes, lagrange_weights(nodes, own))


@dataclass(frozen=True, eq=False)
class Jacobians:
    """A Jacobian (k, 3, q) that is a function of times (k,) in s, at n times; with blocks it is smooth within each."""

    function: Callable[[FloatArray], FloatArray]
    time: FloatArray
    blocks: Blocks | None

    @classmethod
    def of(cls, function: Callable[[FloatArray], FloatArray], time: FloatArray, blocks: Blocks) -> "Jacobians":
        """Those at times (n,); with the blocks if that is faster."""
        return cls(function, time, blocks if blocks.worthwhile else None)

    def times(self, matrix: FloatArray) -> FloatArray:
        """The products (n, 3, p) with a matrix (q, p)."""
        if self.blocks is None:
            return np.concatenate([_times(own, matrix) for _, own in self._parts()])
        values = _times(self._at_blocks, matrix)[self.blocks.of_frame]
        return np.asarray(np.einsum("nc,ncip->nip", self.blocks.weights, values, optimize=True))

    def covariances(self, covariance: FloatArray) -> FloatArray:
        """J C Jᵀ (n, 3, 3) for a covariance C (q, q)."""
        if self.blocks is None:
            return np.concatenate([_times(own, covariance) @ np.swapaxes(own, 1, 2) for _, own in self._parts()])
        moved = _times(self._at_blocks, covariance)
        total = np.zeros((len(self.blocks.weights), 3, 3))
        for i in range(KNOTS):
            for j in range(KNOTS):
                pair = (moved[:, i] @ np.swapaxes(self._at_blocks[:, j], 1, 2))[self.blocks.of_frame]
                total += (self.blocks.weights[:, i] * self.blocks.weights[:, j])[:, None, None] * pair
        return total

    def mean(self, factors: FloatArray) -> FloatArray:
        """The mean (3, q) over the frames of factors (n, 3, 3) times the Jacobian."""
        n = len(factors)
        if self.blocks is None:
            sums = [np.einsum("nij,njq->iq", factors[part], own, optimize=True) for part, own in self._parts()]
            return np.asarray(np.sum(sums, axis=0) / n)
        weighted = (self.blocks.weights[:, :, None, None] * factors[:, None]).reshape(n, -1)
        by_block = np.add.reduceat(weighted, self.blocks.first).reshape(-1, KNOTS, 3, 3)
        return np.asarray(np.einsum("kcij,kcjq->iq", by_block, self._at_blocks, optimize=True) / n)

    @cached_property
    def _at_blocks(self) -> FloatArray:
        """The values (k, KNOTS, 3, q) at the times of the blocks."""
        assert self.blocks is not None  # noqa: S101  the callers have them
        found = self.function(self.blocks.time.ravel())
        return found.reshape(*self.blocks.time.shape, *found.shape[1:])

    def _parts(self) -> Iterator[tuple[slice, FloatArray]]:
        """Parts of the frames whose Jacobians fit the processor's cache, with these."""
        parts = (slice(first, first + PART) for first in range(0, len(self.time), PART))
        return ((part, self.function(self.time[part])) for part in parts)


def _times(values: FloatArray, matrix: FloatArray) -> FloatArray:
    """The products (..., p) of values (..., q) with a matrix (q, p), in one multiplication."""
    return np.asarray((values.reshape(-1, len(matrix)) @ matrix).reshape(*values.shape[:-1], -1))


@dataclass(frozen=True, eq=False)
class Knots:
    """The Jacobians (k, KNOTS, 6, q) at the times of blocks: of rotations and shifts in C by the unknowns."""

    blocks: Blocks
    moves: FloatArray

    @classmethod
    def of(cls, blocks: Blocks, motion: Attitudes, path: Path) -> "Knots":
        """Those of a motion around these blocks, and of a path."""
        time = blocks.time.ravel()
        turn, shift = motion.turn_in_C(time), path.at(time).jacobian
        moves = np.zeros((len(time), 6, turn.shape[2] + shift.shape[2]))
        moves[:, :3, : turn.shape[2]] = turn
        moves[:, 3:, turn.shape[2] :] = shift
        return cls(blocks, moves.reshape(*blocks.time.shape, 6, -1))

    def sums(
        self, part: slice, attitude: FloatArray, matrix: FloatArray, rhs: FloatArray, coupling: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Σ Jᵀ B J (q, q), Σ Jᵀ r (q,) and Σ Jᵀ D (q, p) over the frames of a part, which has whole blocks.

        attitude (n, 3, 3) R_C_B; matrix B (n, 6, 6), rhs r (n, 6) and coupling D (n, 6, p), all in B.
        """
        begin, end = np.searchsorted(self.blocks.first, [part.start, part.stop])
        starts, weights = self.blocks.first[begin:end] - part.start, self.blocks.weights[part]
        in_C = np.concatenate([matrix, rhs[:, :, None], coupling], axis=2)
        in_C[:, :3], in_C[:, 3:] = attitude @ in_C[:, :3], attitude @ in_C[:, 3:]
        R_B_C = np.swapaxes(attitude, 1, 2)
        in_C[:, :, :3], in_C[:, :, 3:6] = in_C[:, :, :3] @ R_B_C, in_C[:, :, 3:6] @ R_B_C
        n, blocks = len(in_C), end - begin
        flat = in_C.reshape(n, -1)
        single = np.stack([np.add.reduceat(flat * weights[:, i, None], starts) for i in range(KNOTS)], axis=1)
        single = single.reshape(blocks, KNOTS, 6, -1)[..., 6:]
        pairs = np.empty((blocks, KNOTS, 6, KNOTS, 6))
        own = np.ascontiguousarray(in_C[:, :, :6]).reshape(n, 36)
        for i in range(KNOTS):
            for j in range(i + 1):
                product = (weights[:, i] * weights[:, j])[:, None]
                pairs[:, i, :, j] = np.add.reduceat(own * product, starts).reshape(blocks, 6, 6)
                pairs[:, j, :, i] = pairs[:, i, :, j]
        moves = self.moves[begin:end].reshape(blocks, 6 * KNOTS, -1)
        q = moves.shape[2]
        jacobian = moves.reshape(-1, q)
        total = jacobian.T @ (pairs.reshape(blocks, 6 * KNOTS, 6 * KNOTS) @ moves).reshape(-1, q)
        others = jacobian.T @ single.reshape(len(jacobian), -1)
        return total, others[:, 0], others[:, 1:]
