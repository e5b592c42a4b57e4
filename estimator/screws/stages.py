"""The stages of all screw methods: tracks → motion → screws → low-pass → pseudo-intersections → polynomial."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.screws.intersection import Intersections, intersect
from baryscope.estimator.screws.low_pass import low_pass_axes
from baryscope.estimator.screws.motion import Pairs, RegisteredMotion, pairs_of, register_motion, step_of
from baryscope.estimator.screws.polynomial import PathFit, fit_path
from baryscope.estimator.screws.screws import REASONS, TOO_LITTLE_ROTATION, Screws, screws_or_nan
from baryscope.estimator.screws.tuning import Trial, choose_cutoff, choose_lag, try_lag
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

ScrewFunction = Callable[[Pairs], Screws]

SIGNIFICANT = 3.0  # standard deviations above which an angle is significant


@dataclass(frozen=True)
class Axes:
    """Filtered axes of the valid screws.

    first, second (k,): frames; axis (k, 3), unit; point (k, 3) in m; deviation (k,): expected standard deviation of the
    axis in rad per direction; raw_deviation (k,): that before the low-pass.
    """

    first: IntArray
    second: IntArray
    axis: FloatArray
    point: FloatArray
    deviation: FloatArray
    raw_deviation: FloatArray


@dataclass(frozen=True)
class Stages:
    """What every stage makes of the tracks, in the working axes W in which they are registered.

    motion: the registered poses; pairs: of frames a lag apart; screws: of the pairs; cutoff: of the low-pass, Hz;
    axes: the filtered axes of the valid screws; one and two (k,): indices of successive axes; crossings: their k
    pseudo-intersections; spread: eigenvalues and eigenvectors of the axes' directions; path: the polynomial through
    the valid pseudo-intersections.
    """

    motion: RegisteredMotion
    pairs: Pairs
    screws: Screws
    cutoff: float
    axes: Axes
    one: IntArray
    two: IntArray
    crossings: Intersections
    spread: tuple[FloatArray, FloatArray]
    path: PathFit

    @property
    def frames(self) -> IntArray:
        """The frame of each pseudo-intersection, (k,): the last of its first axis, the first of its second."""
        return self.axes.second[self.one]


def run_stages(
    screws_of: ScrewFunction, tracks: FeatureTracks, R_W_C: FloatArray | None, options: ScrewOptions
) -> Stages:
    """All stages, in the axes W if R_W_C (n, 3, 3) is given, else in C.

    Raises:
        ComputationError: the tracks do not determine the centre of mass; the message names the reason.
    """
    motion = register_motion(tracks, R_W_C, options.reference)
    trial = choose_lag(motion) if options.lag is None else _given_lag(motion, options.lag)
    cutoff = choose_cutoff(motion, trial) if options.cutoff is None else options.cutoff
    pairs = pairs_of(motion, trial.lag)
    if not len(pairs.first):
        raise ComputationError(
            f"no two frames {counted(trial.lag, 'frame')} apart have an attitude each, in the same interval",
            Reason.SHORT_INTERVALS,
        )
    screws = with_significant_rotation(pairs, screws_of(pairs))
    axes = smooth_axes(pairs, screws, cutoff)
    one, two = successive(axes)
    crossings = intersect(
        axes.axis[one],
        axes.point[one],
        axes.axis[two],
        axes.point[two],
        SIGNIFICANT * np.hypot(axes.deviation[one], axes.deviation[two]),
    )
    spread = axis_spread(axes)
    _check_observable(axes, spread, crossings)
    ok = crossings.valid
    at = motion.time[axes.second[one][ok]]
    span = (float(tracks.time[0]), float(tracks.time[-1]))
    path = fit_path(at, crossings.middle[ok], crossings.sine[ok], span, options.degree)
    return Stages(motion, pairs, screws, cutoff, axes, one, two, crossings, spread, path)


def _given_lag(motion: RegisteredMotion, lag: float) -> Trial:
    """The trial of a lag in s.

    Raises:
        ComputationError: no interval is long enough for two of them in a row.
    """
    frames = max(1, round(lag / step_of(motion)))
    longest = max(interval.length for interval in motion.intervals)
    if longest <= 2 * frames:
        raise ComputationError(
            f"the lag is {lag:g} s, but the longest interval in which the same features are followed lasts "
            f"{(longest - 1) * step_of(motion):g} s, at least twice the lag is needed",
            Reason.SHORT_INTERVALS,
        )
    return try_lag(motion, frames)


def with_significant_rotation(pairs: Pairs, screws: Screws) -> Screws:
    """The screws, with status TOO_LITTLE_ROTATION where the rotation is not significant.

    Raises:
        ComputationError: the median rotation is not above twice that threshold.
    """
    chord, noise = 2 * np.sin(screws.angle / 2), pairs.angle_deviation
    insignificant = screws.valid & ~(chord > SIGNIFICANT * noise)
    if screws.valid.any() and np.nanmedian(chord) <= 2 * SIGNIFICANT * np.median(noise):
        raise ComputationError(
            f"too little rotation: the body turns by {np.rad2deg(np.nanmedian(chord)):.2g}° "
            f"in {counted(pairs.lag, 'frame')}, "
            f"and the noise of that is {np.rad2deg(np.median(noise)):.2g}°",
            Reason.TOO_LITTLE_ROTATION,
        )
    status = np.where(insignificant, TOO_LITTLE_ROTATION, screws.status)
    return screws_or_nan(screws.axis, screws.point, screws.angle, screws.translation, status)


def smooth_axes(pairs: Pairs, screws: Screws, cutoff: float) -> Axes:
    """Low-pass the axes in each run of valid screws at consecutive frames of one interval.

    Raises:
        ComputationError: there is no valid screw.
    """
    valid = np.nonzero(screws.valid)[0]
    if not valid.size:
        raise ComputationError(
            f"no valid screw between poses {counted(pairs.lag, 'frame')} apart: {_invalid_counts(screws)}",
            Reason.DEGENERATE_SCREWS,
        )
    first, motion = pairs.first[valid], pairs.motion
    number = motion.interval[first]
    breaks = np.nonzero((np.diff(first) != 1) | (np.diff(number) != 0))[0] + 1
    axis, point = screws.axis[valid], screws.point[valid]
    step = step_of(motion)
    for run in np.split(np.arange(len(valid)), breaks):
        axis[run], point[run] = low_pass_axes(axis[run], point[run], step, cutoff)
    passed = min(1.0, 2 * cutoff * step)  # share of white noise's variance
    deviation = pairs.angle_deviation[valid] / (2 * np.sin(screws.angle[valid] / 2))
    if passed < 1:
        # The removed part measures the noise of this method's axes; √(2 ln 2) is the median of Rayleigh's distribution.
        removed = np.linalg.norm(axis - screws.axis[valid], axis=1) / np.sqrt(2 * np.log(2) * (1 - passed))
        deviation = deviation * max(1.0, float(np.median(removed) / max(np.median(deviation), 1e-300)))
    return Axes(first, pairs.second[valid], axis, point, np.sqrt(passed) * deviation, deviation)


def successive(axes: Axes) -> tuple[IntArray, IntArray]:
    """Indices of the axes whose second frame is the first frame of another axis, and the indices of the latter."""
    other = np.minimum(np.searchsorted(axes.first, axes.second), len(axes.first) - 1)
    found = np.nonzero(axes.first[other] == axes.second)[0]
    return found, other[found]


def axis_spread(axes: Axes) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues, ascending, and eigenvectors (columns) of the mean of 1 − a aᵀ: the observability of directions."""
    mean = np.eye(3) - axes.axis.T @ axes.axis / len(axes.axis)
    values, vectors = np.linalg.eigh(mean)
    return np.maximum(values, 0.0), vectors


def _check_observable(axes: Axes, spread: tuple[FloatArray, FloatArray], crossings: Intersections) -> None:
    """Check that axes follow one another, and turn by more than their noise.

    spread: see `axis_spread`.

    Raises:
        ComputationError: they do not.
    """
    if not len(crossings.sine):
        raise ComputationError(
            "no two screws follow each other in one interval: the intervals in which the same features are "
            "followed are shorter than twice the lag",
            Reason.SHORT_INTERVALS,
        )
    # The deviation before the low-pass, as the filter passes more than its nominal bandwidth near the ends of a run.
    noise = float(np.sqrt(2 * np.mean(axes.raw_deviation**2)))
    rms_angle = float(np.sqrt(spread[0][0]))
    if rms_angle <= max(SIGNIFICANT * noise, 1e-6) or not crossings.valid.any():
        raise ComputationError(
            f"the axis of rotation does not turn visibly ({np.rad2deg(rms_angle):.2g}° rms, noise "
            f"{np.rad2deg(noise):.2g}°): in a pure spin the centre of mass cannot be found along the axis",
            Reason.PURE_SPIN,
        )


def _invalid_counts(screws: Screws) -> str:
    counts = np.bincount(screws.status, minlength=len(REASONS))
    reasons = [f"{REASONS[code]} ({counts[code]})" for code in np.argsort(-counts) if code and counts[code]]
    return ", ".join(reasons)
