"""Gaps: where tracks have no frames, so that nothing was seen, or nobody looked.

In a CSV file what is not seen has no row, and a blackout has no frames.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]

LONGEST = 3.0  # of what a long step between two frames usually is
USUAL = 0.75  # quantile of the steps
NEARBY = 15  # steps, for a sampling interval that changes
MOST_SHADES = 400


def gaps_of(time: FloatArray) -> IntArray:
    """Indices (k,) of the frames of time (n,), s, after which there is a gap.

    Its step is several times as long as three quarters of all are, and of those nearby: frames may be irregular, and
    their rate may change.
    """
    step = np.diff(time)
    if len(step) < 3:
        return np.empty(0, dtype=np.intp)
    usual = np.asarray(np.quantile(step, USUAL, method="lower"))
    if len(step) > NEARBY:
        nearby = np.lib.stride_tricks.sliding_window_view(np.pad(step, NEARBY // 2, mode="reflect"), NEARBY)
        usual = np.maximum(usual, np.quantile(nearby, USUAL, axis=1, method="lower"))
    return np.flatnonzero(step > LONGEST * usual)


def blackouts(time: FloatArray, seen: BoolArray) -> tuple[tuple[float, float], ...]:
    """Intervals, s, in which nothing is seen (n, m), from a first frame without an observation, or a last one before a
    gap, to the next frame with one. Of very many the longest.
    """
    dark = np.logical_not(seen.any(axis=1))[:-1]
    dark[gaps_of(time)] = True
    edges = np.flatnonzero(np.diff(dark.astype(int), prepend=0, append=0)).reshape(-1, 2)
    begin, end = time[edges].T
    longest = np.sort(np.argsort(begin - end, kind="stable")[:MOST_SHADES])
    return tuple(zip(begin[longest].tolist(), end[longest].tolist(), strict=True))
