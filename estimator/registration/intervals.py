"""Intervals: stretches of time in which one cluster of features is followed without a gap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

GAP = 1.5  # a step in time longer than this many usual steps is a gap


@dataclass(frozen=True)
class Interval:
    """Frames start, …, stop - 1 of the tracks, in all of which the cluster of the first is followed."""

    start: int
    stop: int
    features: tuple[int, ...]  # all that are seen in it at some time, in the order of the tracks

    @property
    def frames(self) -> slice:
        """The interval's frames, to index with."""
        return slice(self.start, self.stop)

    @property
    def length(self) -> int:
        """The number of frames."""
        return self.stop - self.start


def usual_step(time: NDArray[np.float64]) -> float:
    """Sampling interval in s: the median step of time (n,); 1 where there is only one frame."""
    return float(np.median(np.diff(time))) if len(time) > 1 else 1.0


def find_intervals(tracks: FeatureTracks) -> tuple[Interval, ...]:
    """Cut the tracks where time has a gap, fewer than three features are seen, or the cluster has changed.

    An interval goes on while at least three, and at least half, of the features of its first frame are seen.
    """
    return cut_intervals(tracks.seen, np.diff(tracks.time) > GAP * usual_step(tracks.time))


def cut_intervals(seen: NDArray[np.bool_], gaps: NDArray[np.bool_]) -> tuple[Interval, ...]:
    """The intervals of seen (n, m), with gaps (n - 1,) between some of the frames."""
    enough = seen.sum(axis=1) >= 3
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
    """The first frame that no longer follows the cluster of frame `start`.

    Looked for in windows of growing length, so that many short intervals cost no more than a few long ones.
    """
    cluster = seen[start]
    wanted = max(3.0, cluster.sum() / 2)
    window = 64
    while start < stop:
        end = min(start + window, stop)
        lost = (seen[start:end] & cluster).sum(axis=1) < wanted
        if lost.any():
            return start + int(np.argmax(lost))
        start, window = end, 2 * window
    return stop


def too_few_features(seen: NDArray[np.bool_]) -> ComputationError:
    """The error where no frame of seen (n, m) has three features."""
    most = int(seen.sum(axis=1).max(initial=0))
    return ComputationError(
        f"at most {counted(most, 'feature is', 'features are')} seen together in a frame, "
        "at least 3 are needed for an attitude",
        Reason.TOO_FEW_FEATURES,
    )


def collinear_features() -> ComputationError:
    """The error where what is seen together gives no attitude."""
    return ComputationError(
        "the features seen together lie in a line, or too near one, to give an attitude", Reason.COLLINEAR_FEATURES
    )
