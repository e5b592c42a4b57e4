"""The registered rigid motion of the target over all intervals, from which the screw methods start."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import Reference
from baryscope.estimator.registration.intervals import (
    Interval,
    collinear_features,
    find_intervals,
    sampling_interval,
    too_few_features,
)
from baryscope.estimator.registration.procrustes import Registration, register
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class RegisteredMotion:
    """Tracks in working axes W (inertial or LVLH, origin at the chaser) and the poses registered from them.

    time (n,) in s; position (n, m, 3) in m, NaN = not seen; interval (n,), the index of each frame's interval or -1;
    rotation (n, 3, 3) R_W_S and centre (n, 3) in m of the interval's shape, NaN in frames without a pose.
    """

    time: FloatArray
    position: FloatArray
    interval: IntArray
    rotation: FloatArray
    centre: FloatArray
    intervals: tuple[Interval, ...]
    registrations: tuple[Registration, ...]

    @property
    def posed(self) -> NDArray[np.bool_]:
        """The frames with a pose, (n,)."""
        return np.asarray(np.isfinite(self.centre[:, 0]))

    @property
    def rms(self) -> float:
        """Standard deviation of a coordinate in m, from the residuals of the registration in all intervals."""
        frames = np.array([interval.length for interval in self.intervals], dtype=np.float64)
        squares = np.array([registration.rms**2 for registration in self.registrations])
        return float(np.sqrt(frames @ squares / frames.sum()))

    def per_frame(self, values: list[float]) -> FloatArray:
        """Values per interval as values per frame, (n,); NaN outside the intervals."""
        return np.asarray(np.array([*values, np.nan])[self.interval])


def register_motion(tracks: FeatureTracks, R_W_C: FloatArray | None, reference: Reference) -> RegisteredMotion:
    """Register each interval of the tracks, in W if R_W_C (n, 3, 3) is given, else in C.

    Raises:
        ComputationError: no frame sees three features, or they are collinear in all frames.
    """
    intervals = find_intervals(tracks)
    if not intervals:
        raise too_few_features(tracks.seen)
    position = tracks.position
    if R_W_C is not None:
        position = position @ np.swapaxes(R_W_C, 1, 2)
    n = len(tracks.time)
    number = np.full(n, -1, dtype=np.intp)
    rotation, centre = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan)
    registrations = []
    for index, interval in enumerate(intervals):
        frames = interval.frames
        fitted = register(position[frames][:, list(interval.features)], reference)
        registrations.append(fitted)
        number[frames] = index
        rotation[frames] = np.where(fitted.valid[:, None, None], fitted.rotation, np.nan)
        centre[frames] = np.where(fitted.valid[:, None], fitted.translation, np.nan)
    motion = RegisteredMotion(tracks.time, position, number, rotation, centre, intervals, tuple(registrations))
    if not motion.posed.any():
        raise collinear_features()
    return motion


@dataclass(frozen=True)
class Pairs:
    """Pairs of frames of a motion, `lag` frames apart in one interval: first and second (k,), indices of frames."""

    motion: RegisteredMotion
    lag: int
    first: IntArray
    second: IntArray

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation of a coordinate in m in each pair's interval, (k,)."""
        return self.motion.per_frame([fitted.rms for fitted in self.motion.registrations])[self.first]

    @property
    def angle_deviation(self) -> FloatArray:
        """Standard deviation in rad of the rotation between the two poses about any axis, (k,)."""
        one = self.motion.per_frame([fitted.angle_deviation for fitted in self.motion.registrations])[self.first]
        return np.asarray(np.sqrt(2.0) * one)


def pairs_of(motion: RegisteredMotion, lag: int) -> Pairs:
    """All pairs of frames with poses, `lag` frames apart within an interval."""
    n = len(motion.time)
    first = np.arange(max(n - lag, 0))
    second = first + lag
    same = (motion.interval[first] >= 0) & (motion.interval[first] == motion.interval[second])
    keep = same & motion.posed[first] & motion.posed[second]
    return Pairs(motion, lag, first[keep], second[keep])


def step_of(motion: RegisteredMotion) -> float:
    """Sampling interval in s."""
    return sampling_interval(motion.time)
