"""Fewer points than were computed, so that a report stays small, and nothing that can be seen is lost."""

import numpy as np
from numpy.typing import NDArray

from baryscope.report.gaps import gaps_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

CURVE = 900  # points of a curve: as many as a wide chart has pixels
BINS = 400  # of a row of a timeline


def evenly(count: int, most: int) -> IntArray:
    """Indices of at most `most` of `count` items, evenly spread, the first and the last among them."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, most)).astype(np.intp))


def extremes(y: FloatArray, most: int = CURVE) -> IntArray:
    """Indices of a curve's (n,) least and greatest value in each of `most / 2` bins; NaN is kept as a gap.

    A bin with some NaN keeps its first one.
    """
    n = len(y)
    if n <= most:
        return np.arange(n)
    edges = np.linspace(0, n, most // 2 + 1).astype(np.intp)
    place = np.repeat(np.arange(len(edges) - 1), np.diff(edges))

    def first(flags: BoolArray) -> IntArray:
        """The first of each bin's that have the flag."""
        found = np.flatnonzero(flags)
        return found[np.unique(place[found], return_index=True)[1]]

    least, greatest = (extreme.reduceat(y, edges[:-1])[place] for extreme in (np.fmin, np.fmax))
    ends = np.array([0, n - 1])
    return np.unique(np.concatenate([ends, first(np.isnan(y)), first(y == least), first(y == greatest)]))


def shares(time: FloatArray, flags: BoolArray, bins: int = BINS) -> tuple[str, ...]:
    """For each column of flags (n, m) a text of a digit a bin of time: the share of its frames that have the flag, 0–9.

    A share above zero is at least 1, and one below one at most 8. Bins without a frame have that of the frame before,
    but in gaps 0.
    """
    edges = np.linspace(time[0], time[-1], bins + 1)[1:-1]
    place = np.searchsorted(edges, time, side="right")
    total = np.bincount(place, minlength=bins)
    filled = np.maximum.accumulate(np.where(total > 0, np.arange(bins), 0))
    gaps = gaps_of(time)
    first, last = place[gaps] + 1, place[gaps + 1]  # bins of each gap, the last excluded
    inside = np.cumsum(np.bincount(first, minlength=bins + 1) - np.bincount(last, minlength=bins + 1))[:bins] > 0
    rows = []
    for column in flags.T:
        share = np.bincount(place, weights=column, minlength=bins) / np.maximum(total, 1)
        digit = np.where(share <= 0, 0, np.where(share >= 1, 9, np.clip(np.round(9 * share), 1, 8)))[filled]
        digit[inside] = 0
        rows.append("".join(map(str, digit.astype(int).tolist())))
    return tuple(rows)
