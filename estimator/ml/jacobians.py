"""Jacobians of rotation and path at many frames, from few knots where these suffice."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.blocks import KNOTS, Blocks
from baryscope.estimator.dynamics.rotation import Attitudes

FloatArray = NDArray[np.float64]

PHASE = 3.6  # rad of the highest frequency in a block: an error of 1e-9, and of 6e-4 of a wave of thrice that frequency
FEWEST = 1000  # frames, and
WORTHWHILE = 1.5  # frames of a knot, on average, from which sums over knots are faster
PART = 256  # frames whose Jacobians are evaluated together


@dataclass(frozen=True, eq=False)
class Jacobians:
    """A Jacobian (k, 3, q) that is a function of times (k,) in s, at n times; with blocks it is smooth within each."""

    function: Callable[[FloatArray], FloatArray]
    time: FloatArray
    blocks: Blocks | None

    @classmethod
    def of(cls, function: Callable[[FloatArray], FloatArray], time: FloatArray, blocks: Blocks) -> "Jacobians":
        """Those at times (n,); with the blocks if that is faster."""
        return cls(function, time, blocks if worthwhile(blocks) else None)

    def times(self, matrix: FloatArray) -> FloatArray:
        """The products (n, 3, p) with a matrix (q, p)."""
        if self.blocks is None:
            return np.concatenate([_times(own, matrix) for _, own in self._parts()])
        return self.blocks.at_frames(_times(self._at_knots, matrix))

    def covariances(self, covariance: FloatArray) -> FloatArray:
        """J C Jᵀ (n, 3, 3) for a covariance C (q, q)."""
        if self.blocks is None:
            return np.concatenate([_times(own, covariance) @ np.swapaxes(own, 1, 2) for _, own in self._parts()])
        return self.blocks.covariances(self._at_knots, covariance)

    def mean(self, factors: FloatArray) -> FloatArray:
        """The mean (3, q) over the frames of factors (n, 3, 3) times the Jacobian."""
        n = len(factors)
        if self.blocks is None:
            sums = [np.einsum("nij,njq->iq", factors[part], own, optimize=True) for part, own in self._parts()]
            return np.asarray(np.sum(sums, axis=0) / n)
        by_knot = self.blocks.sums(slice(None), factors.reshape(n, 9)).reshape(-1, 3, 3)
        return np.asarray(np.einsum("kij,kjq->iq", by_knot, self._at_knots, optimize=True) / n)

    @cached_property
    def _at_knots(self) -> FloatArray:
        """The values (k KNOTS, 3, q) at the knots."""
        assert self.blocks is not None  # noqa: S101  the callers have them
        return self.function(self.blocks.knots.ravel())

    def _parts(self) -> Iterator[tuple[slice, FloatArray]]:
        """Parts of the frames whose Jacobians fit the processor's cache, with these."""
        parts = (slice(first, first + PART) for first in range(0, len(self.time), PART))
        return ((part, self.function(self.time[part])) for part in parts)


def _times(values: FloatArray, matrix: FloatArray) -> FloatArray:
    """The products (..., p) of values (..., q) with a matrix (q, p), in one multiplication."""
    return np.asarray((values.reshape(-1, len(matrix)) @ matrix).reshape(*values.shape[:-1], -1))


@dataclass(frozen=True, eq=False)
class Knots:
    """The Jacobians at the knots of blocks: of rotations in C around them, and the path's (k KNOTS, 3, p)."""

    blocks: Blocks
    motion: Attitudes
    path: FloatArray

    def sums(
        self, part: slice, attitude: FloatArray, matrix: FloatArray, rhs: FloatArray, coupling: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Σ Jᵀ B J (q, q), Σ Jᵀ r (q,) and Σ Jᵀ D (q, p) over the frames of a part; J (6, q) turns, then shifts.

        attitude (n, 3, 3) R_C_B; matrix B (n, 6, 6), rhs r (n, 6) and coupling D (n, 6, p), all in B.
        """
        R_B_C = np.swapaxes(attitude, 1, 2)
        in_C = np.concatenate([matrix, rhs[:, :, None], coupling], axis=2)
        in_C[:, :3], in_C[:, 3:] = attitude @ in_C[:, :3], attitude @ in_C[:, 3:]
        in_C[:, :, :3], in_C[:, :, 3:6] = in_C[:, :, :3] @ R_B_C, in_C[:, :, 3:6] @ R_B_C
        n = len(in_C)
        held = self.blocks.around(part)[0]
        knots = slice(KNOTS * held.start, KNOTS * held.stop)
        turn, shift = self.motion.turn_in_C(self.blocks.knots[held].ravel()), self.path[knots]
        pairs = self.blocks.pair_sums(part, in_C[:, :, :6].reshape(n, 36)).reshape(-1, KNOTS, KNOTS, 6, 6)
        single = self.blocks.sums(part, in_C[:, :, 6:].reshape(n, -1)).reshape(len(turn), 6, -1)

        def crossed(a: slice, b: slice, jacobian: FloatArray) -> FloatArray:
            """Σ B J for the rows a and columns b of B, flat over the knots (3 k KNOTS, size)."""
            own = pairs[..., a, b].transpose(0, 1, 3, 2, 4).reshape(-1, 3 * KNOTS, 3 * KNOTS)
            size = jacobian.shape[2]
            return np.asarray((own @ jacobian.reshape(-1, 3 * KNOTS, size)).reshape(-1, size))

        turned, shifted = slice(0, 3), slice(3, 6)
        by_turn, by_shift = (values.reshape(-1, values.shape[2]).T for values in (turn, shift))
        both = by_turn @ crossed(turned, shifted, shift)
        total = np.block(
            [
                [by_turn @ crossed(turned, turned, turn), both],
                [both.T, by_shift @ crossed(shifted, shifted, shift)],
            ]
        )
        others = np.concatenate(
            [
                by_turn @ single[:, turned].reshape(-1, single.shape[2]),
                by_shift @ single[:, shifted].reshape(-1, single.shape[2]),
            ]
        )
        return total, others[:, 0], others[:, 1:]


def worthwhile(blocks: Blocks) -> bool:
    """Whether sums over knots are faster than those over frames."""
    return len(blocks.weights) >= max(FEWEST, WORTHWHILE * blocks.knots.size)
