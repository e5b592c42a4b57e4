"""Intervals: periods in which one cluster of features is tracked without a gap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

GAP = 1.5  # sampling intervals: a longer step in time is a gap


@dataclass(frozen=True)
class Interval:
    """Frames start, …, stop - 1 of the tracks, which all see the cluster of the first frame.

    features: indices of all features that are seen in some frame of it, ascending.
    """

    start: int
    stop: int
    features: tuple[int, ...]

    @property
    def frames(self) -> slice:
        """The interval's frames as a slice."""
        return slice(self.start, self.stop)

    @property
    def length(self) -> int:
        """The number of frames."""
        return self.stop - self.start


def sampling_interval(time: NDArray[np.float64]) -> float:
    """Sampling interval in s: the median step of time (n,); 1 where there is only one frame."""
    return float(np.median(np.diff(time))) if len(time) > 1 else 1.0


def runs_of(rows: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The first index and that after the last (k, 2) of each run of True in rows (n,)."""
    return np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)


def find_intervals(tracks: FeatureTracks) -> tuple[Interval, ...]:
    """Cut the tracks at gaps in time, at frames with fewer than three features, and where the cluster changes.

    An interval continues while at least three, and at least half, of the features of its first frame are seen.
    """
    return cut_intervals(tracks.seen, np.diff(tracks.time) > GAP * sampling_interval(tracks.time))


def cut_intervals(seen: NDArray[np.bool_], gaps: NDArray[np.bool_]) -> tuple[Interval, ...]:
    """The intervals of seen (n, m); gaps (n - 1,) is True where a gap follows the frame."""
    enough = seen.sum(axis=1) >= FEWEST_POINTS
    cut = np.concatenate([[True], gaps | (enough[1:] != enough[:-1]), [True]])
    borders = np.nonzero(cut)[0]
    intervals: list[Interval] = []
    for start, stop in zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True):
        if not enough[start]:
            continue
        while start < stop:
            end = _end_of_cluster(seen, start, stop)
            features = np.nonzero(seen[start:end].any(axis=0))[0]
            intervals.append(Interval(start, end, tuple(features.tolist())))
            start = end
    return tuple(intervals)


def _end_of_cluster(seen: NDArray[np.bool_], start: int, stop: int) -> int:
    """The first frame that no longer sees the cluster of frame `start`.

    The search uses windows of growing length, so that many short intervals cost no more than a few long ones.
    """
    cluster = seen[start]
    required = max(3.0, cluster.sum() / 2)
    window = 64
    while start < stop:
        end = min(start + window, stop)
        changed = (seen[start:end] & cluster).sum(axis=1) < required
        if changed.any():
            return start + int(np.argmax(changed))
        start, window = end, 2 * window
    return stop


def too_few_features(seen: NDArray[np.bool_]) -> ComputationError:
    """The error to raise if no frame of seen (n, m) has three features."""
    most = int(seen.sum(axis=1).max(initial=0))
    return ComputationError(
        f"at most {counted(most, 'feature is', 'features are')} seen together in a frame, "
        "at least 3 are needed for an attitude",
        Reason.TOO_FEW_FEATURES,
    )


def collinear_features() -> ComputationError:
    """The error to raise if the features seen together are collinear and give no attitude."""
    return ComputationError(
        "the features seen together lie in a line, or too near one, to give an attitude", Reason.COLLINEAR_FEATURES
    )
