"""The online estimate of tracks that are there already: what the filter would have told after each of their frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.online.answers import OnlineStatus
from baryscope.estimator.online.core import MOST_FEATURES
from baryscope.estimator.online.estimator import OnlineEstimator
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.orbit import Orbit
from baryscope.models.words import brief

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class OnlineCourse:
    """What a filter told after each of n frames.

    time (n,), s; position (n, 3) of the centre of mass in C, m, and its covariance (n, 3, 3), m², NaN while the filter
    waits; tracking (n,): whether its status is so; tumble (n,): whether it knows the tumble, or did in a frame before.
    """

    time: FloatArray
    position: FloatArray
    covariance: FloatArray
    tracking: BoolArray
    tumble: BoolArray

    __repr__ = brief


def course_of(
    filter: OnlineEstimator,
    time: FloatArray,
    position: FloatArray,
    covariance: FloatArray | None = None,
    pushes: FloatArray | None = None,
) -> OnlineCourse:
    """Hand frames to a filter that has taken none, one after the other.

    Args:
        filter: of the orbit and the noise.
        time: of the frames, (n,), s.
        position: of the features, (n, m, 3) in C, m; NaN where one is not seen. Of a frame with more than the filter
            can hold, it sees the first.
        covariance: of the positions, (n, m, 3, 3), m².
        pushes: the chaser's mean acceleration since the frame before, (n, 3) in C, m/s².

    Raises:
        InputError: the filter refuses a frame.
    """
    seen = seen_at_once(position)
    tumble = False
    found = OnlineCourse(
        time,
        np.full((len(time), 3), np.nan),
        np.full((len(time), 3, 3), np.nan),
        np.zeros(len(time), dtype=bool),
        np.zeros(len(time), dtype=bool),
    )
    for k, moment in enumerate(time.tolist()):
        of_frame = None if covariance is None else covariance[k]
        push = None if pushes is None else pushes[k]
        state = filter.update(moment, position[k], seen[k], covariance=of_frame, acceleration=push)
        tumble = tumble or filter.tumble(moment) is not None
        found.tumble[k], found.tracking[k] = tumble, state.status is OnlineStatus.TRACKING
        if state.status is not OnlineStatus.WAITING:
            found.position[k], found.covariance[k] = state.position, state.covariance[:3, :3]
    return found


def seen_at_once(position: FloatArray) -> BoolArray:
    """Which features (n, m) of positions (n, m, 3) are seen, of each frame the first that a filter can hold."""
    seen = np.isfinite(position).all(axis=2)
    return np.asarray(seen & (np.cumsum(seen, axis=1) <= MOST_FEATURES))


def mean_pushes(log: KnownAcceleration, time: FloatArray, orbit: Orbit | None) -> FloatArray:
    """The mean acceleration (n, 3) of the chaser in C, m/s², since the time before, of times (n,) in s, by a log.

    Raises:
        InputError: the log is in LVLH axes, and there is no orbit.
    """
    gained = np.concatenate([np.zeros((1, 3)), np.cumsum(np.diff(log.time)[:, None] * log.value[:-1], axis=0)])
    row = np.maximum(log.held_at(time), 0)
    speed = gained[row] + np.maximum(time - log.time[row], 0.0)[:, None] * log.value[row]
    R_C_D = log.axes_at((time[1:] + time[:-1]) / 2, orbit)
    found = np.zeros((len(time), 3))
    found[1:] = np.einsum("nij,nj->ni", R_C_D, np.diff(speed, axis=0) / np.diff(time)[:, None])
    return found
