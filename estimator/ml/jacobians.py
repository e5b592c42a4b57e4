"""Jacobians of rotation and path at many frames, from few knots where these suffice."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.rotation import Attitudes
from baryscope.estimator.geometry.symmetric import FULL, elements_of
from baryscope.estimator.paths.blocks import FEWEST, KNOTS, Blocks

FloatArray = NDArray[np.float64]

PHASE = 3.6  # rad of the highest frequency in a block: an error of 1e-9, and of 6e-4 of a wave of thrice that frequency
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
        """The Jacobians at times (n,); with the blocks if that is faster."""
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

    def around(self, part: slice) -> "KnotsAround":
        """The knots of the blocks around a part of the frames."""
        held = self.blocks.around(part)[0]
        turn = self.motion.turn_in_C(self.blocks.knots[held].ravel())
        return KnotsAround(self.blocks, part, turn, self.path[KNOTS * held.start : KNOTS * held.stop])


@dataclass(frozen=True, eq=False)
class KnotsAround:
    """The Jacobians of turn (k, 3, q) and shift (k, 3, p), in C, at the knots of the blocks around a part."""

    blocks: Blocks
    part: slice
    turn: FloatArray
    shift: FloatArray

    def matrices(self, turn: FloatArray, crossed: FloatArray, shift: FloatArray) -> tuple[FloatArray, ...]:
        """Σ Jᵀ B J (q, q) of turns, (q, p) of turns and shifts, and (p, p) of shifts, for blocks B (n, 3, 3) in C."""
        values = np.concatenate([elements_of(turn), crossed.reshape(-1, 9), elements_of(shift)], axis=1)
        places = FULL, 6 + np.arange(9).reshape(3, 3), 15 + FULL
        sides = (self.turn, self.turn), (self.turn, self.shift), (self.shift, self.shift)
        by_pair = self.blocks.pair_sums(self.part, values, *places)
        return tuple(_product(left, own, right) for own, (left, right) in zip(by_pair, sides, strict=True))

    def moments(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Σ Jᵀ v of turns (q, c) and of shifts (p, c) for values v (n, 3, c) in C."""
        n, _, columns = values.shape
        by_knot = self.blocks.sums(self.part, values.reshape(n, 3 * columns)).reshape(-1, columns)
        turn, shift = (own.reshape(len(by_knot), -1).T @ by_knot for own in (self.turn, self.shift))
        return turn, shift


def _product(left: FloatArray, blocks: FloatArray, right: FloatArray) -> FloatArray:
    """Σ Lᵀ B R (q, p) for blocks B (b, 3 KNOTS, 3 KNOTS), L (b KNOTS, 3, q) and R (b KNOTS, 3, p)."""
    weighted = blocks @ right.reshape(len(blocks), 3 * KNOTS, -1)
    return np.asarray(left.reshape(-1, left.shape[2]).T @ weighted.reshape(-1, right.shape[2]))


def worthwhile(blocks: Blocks) -> bool:
    """Whether sums over knots are faster than those over frames."""
    return len(blocks.weights) >= max(FEWEST, WORTHWHILE * blocks.knots.size)
