"""Where a recording's noise changes, as the distances between features tell, which need no pose.

The frames are taken in blocks of equal size. In each, a quantile over the pairs of features of their medians of
|d − d₀| tells the noise, d₀ the pair's typical distance: single features that are off in a block, and single frames,
tell nothing. The logarithms of the blocks' deviations are cut in two where their means differ most, and the parts in
turn, as long as the difference is large, and no chance for blocks that hang together as these do.

Few frames of few features have distances that scatter much from block to block. The residuals of an estimate scatter
less, but a path or a body that does not fit changes them, too. So where distances tell no change, residuals may tell
where one is, if the distances in the parts differ by as much.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.registration.noise import QUARTILE
from baryscope.estimator.registration.screening import distances_between

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

BLOCKS, LEAST_BLOCK = 48, 6  # of a recording at most, and frames of one at least
LEAST_BLOCKS = 3  # of a part
QUIETER = 0.3  # share of the pairs in a block, that are quieter than what counts
LEAST_PAIRS = 3  # of features, whose distances tell the noise
RATIO = 2.0  # of deviations, from which noise changes
CHANCE = 5.0  # standard deviations of the difference of two parts' logarithms, below which it is chance
BODY = 0.1  # of the typical distances: a deviation that is more is no noise


@dataclass(frozen=True)
class Part:
    """Frames begin, …, end − 1 of the tracks, with one deviation of a coordinate, m."""

    begin: int
    end: int
    deviation: float


@dataclass(frozen=True, eq=False)
class Misfit:
    """What an estimate of rigid bodies leaves of a frame's observations, without those that it rejects.

    squares (n,): of the residuals, m²; freedom (n,): of so many values beside those that the frame's pose takes.
    """

    squares: FloatArray
    freedom: FloatArray

    def deviation(self, frames: IntArray) -> float:
        """That of a coordinate in some frames, m."""
        return float(np.sqrt(self.squares[frames].sum() / self.freedom[frames].sum()))


def noise_parts(position: FloatArray, seen: BoolArray, misfit: Misfit | None = None) -> tuple[Part, ...]:
    """The parts of the frames of positions (n, m, 3) in m with noise of their own, at least two; none if it is alike.

    seen (n, m); misfit: of an estimate, which is asked where distances show no change. There are none either where
    distances change by more than noise could.
    """
    distances = distances_between(position, seen)
    off = np.abs(distances.off)
    if off.shape[1] < LEAST_PAIRS:
        return ()
    by_distances = _begins(np.isfinite(off).sum(axis=1) > 0, lambda rows: _deviation(off[rows], QUIETER))
    begins = by_distances
    if misfit is not None and not begins:
        begins = _begins(misfit.freedom > 0, misfit.deviation)
    ends = [0, *begins, len(position)]
    if not begins or not all(np.isfinite(off[a:b]).any() for a, b in pairwise(ends)):
        return ()
    parts = tuple(Part(a, b, _deviation(off[a:b], 0.5)) for a, b in pairwise(ends))
    if not by_distances and min(_ratio(a, b) for a, b in pairwise(parts)) < RATIO:
        return ()
    size = float(np.sqrt(np.mean(distances.typical**2)))
    return () if max(one.deviation for one in parts) > BODY * size else parts


def _begins(shown: BoolArray, deviation: Callable[[IntArray], float]) -> list[int]:
    """The frames with which the noise changes, ascending, of those that are shown (n,), by the deviation in blocks."""
    frames = np.flatnonzero(shown)
    count = min(BLOCKS, len(frames) // LEAST_BLOCK)
    if count < 2 * LEAST_BLOCKS:
        return []
    blocks = np.array_split(frames, count)
    deviations = np.array([deviation(rows) for rows in blocks])
    return [int(blocks[cut][0]) for cut in _cuts(np.log(deviations))] if (deviations > 0).all() else []


def _ratio(one: Part, other: Part) -> float:
    """The deviation of the noisier of two parts over that of the other."""
    return max(one.deviation, other.deviation) / max(min(one.deviation, other.deviation), np.finfo(float).tiny)


def _deviation(off: FloatArray, quantile: float) -> float:
    """The deviation of a coordinate, m, that distances (n, k) tell which are off by so much, NaN where not seen.

    The noise of a distance is that of both its ends along it.
    """
    medians = np.sort(
        [np.median(own[known]) for own, known in zip(off.T, np.isfinite(off).T, strict=True) if known.any()]
    )
    return float(medians[int(quantile * (len(medians) - 1))] / (QUARTILE * np.sqrt(2)))


def _cuts(values: FloatArray, first: int = 0) -> list[int]:
    """Where a series (n,) changes its mean, ascending; first: the index of its first value in a longer series."""
    found = []
    for cut in range(LEAST_BLOCKS, len(values) - LEAST_BLOCKS + 1):
        before, after = values[:cut], values[cut:]
        apart = abs(float(before.mean() - after.mean()))
        left = np.concatenate([before - before.mean(), after - after.mean()])
        square = float(np.sum(left**2))
        gained = float(np.sum((values - values.mean()) ** 2)) - square
        found.append((gained, apart, _uncertainty(before, after, left), cut))
    if not found:
        return []
    _, apart, uncertainty, cut = max(found)
    if apart < np.log(RATIO) or apart < CHANCE * uncertainty:
        return []
    return [*_cuts(values[:cut], first), first + cut, *_cuts(values[cut:], first + cut)]


def _uncertainty(before: FloatArray, after: FloatArray, left: FloatArray) -> float:
    """The standard deviation of the difference of two parts' means; left: of each value from its part's mean.

    Values that follow one another hang together as those of an autoregression of the first order.
    """
    squares = float(np.sum(left**2))
    rho = float(np.clip(np.sum(left[1:] * left[:-1]) / max(squares, 1e-300), 0.0, 0.95))
    variance = before.var(ddof=1) / len(before) + after.var(ddof=1) / len(after)
    return float(np.sqrt(variance * (1 + rho) / (1 - rho)))
