"""The pipeline of all screw methods: tracks → axes → motion → screws → low-pass → pseudo-intersections → polynomial."""

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import ScrewDetails
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.screws.intersection import Intersections, intersect
from baryscope.estimator.screws.low_pass import low_pass_axes
from baryscope.estimator.screws.motion import Pairs, RegisteredMotion, pairs_of, register_motion, step_of
from baryscope.estimator.screws.polynomial import PathFit, fit_path
from baryscope.estimator.screws.screws import REASONS, TOO_LITTLE_ROTATION, Screws, screws_or_nan
from baryscope.estimator.screws.tuning import Trial, choose_cutoff, choose_lag, try_lag
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit
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


def estimate_by_screws(
    name: str, screws_of: ScrewFunction, tracks: FeatureTracks, orbit: Orbit | None, options: ScrewOptions
) -> Estimate:
    """The centre of mass from the screws that `screws_of` computes for pairs of frames.

    Raises:
        InputError: LVLH axes without an orbit.
        ComputationError: the tracks do not determine the centre of mass; the message names the reason.
    """
    begin = clock.perf_counter()
    R_C_W = None
    if options.axes == "lvlh":
        if orbit is None:
            raise InputError("axes are lvlh, which needs the target's orbit; expected an orbit, or axes inertial")
        R_C_W = lvlh_attitude(orbit, tracks.time)
    motion = register_motion(tracks, None if R_C_W is None else np.swapaxes(R_C_W, 1, 2), options.reference)
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
    lvlh = None if R_C_W is None or orbit is None else (R_C_W, lvlh_rate(orbit, tracks.time))
    position, velocity = _in_C(path, tracks.time, lvlh)
    clusters = tuple(_clusters(tracks, motion, path(tracks.time)))
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=position,
        covariance=None,
        motion=Motion(velocity=velocity),
        observability=None,
        clusters=tuple(cluster for cluster, _ in clusters),
        noise=Noise(None, motion.rms),
        residuals=_residuals(motion, R_C_W),
        used=tracks.seen & motion.posed[:, None],
        rejected=np.zeros_like(tracks.seen),
        covered=np.isin(np.arange(len(tracks.time)), axes.second[one][ok]),
        converged=all(fitted.converged for fitted in motion.registrations),
        rounds=max(fitted.rounds for fitted in motion.registrations),
        findings=(),
        method=name,
        path=f"polynomial:{path.degree}" if path.degree else "fixed",
        options=replace(options, lag=trial.lag * step_of(motion), cutoff=cutoff, degree=path.degree),
        details=replace(
            _details(options, motion, screws, crossings, path, spread),
            com_scatter=tuple(scatter for _, scatter in clusters),
        ),
        wall_time=clock.perf_counter() - begin,
    )


def _in_C(path: PathFit, time: FloatArray, lvlh: tuple[FloatArray, FloatArray] | None) -> tuple[FloatArray, FloatArray]:
    """Position and velocity of a path in C; lvlh: R_C_W (n, 3, 3) and angular rate (n,) of its axes W."""
    position, velocity = path(time), path.velocity(time)
    if lvlh is None:
        return position, velocity
    R_C_W, rate = lvlh
    velocity = velocity + rate[:, None] * np.cross([0.0, 0.0, 1.0], position)
    in_C = (np.einsum("nij,nj->ni", R_C_W, values) for values in (position, velocity))
    return next(in_C), next(in_C)


def _residuals(motion: RegisteredMotion, R_C_W: FloatArray | None) -> FloatArray:
    """Residuals of the registration, (n, m, 3) in C, m."""
    residual = np.full_like(motion.position, np.nan)
    for interval, fitted in zip(motion.intervals, motion.registrations, strict=True):
        columns = list(interval.features)
        left = motion.position[interval.frames][:, columns] - fitted.rigid_points
        residual[interval.frames, columns] = np.where(fitted.valid[:, None, None], left, np.nan)
    return residual if R_C_W is None else residual @ np.swapaxes(R_C_W, 1, 2)


def _given_lag(motion: RegisteredMotion, lag: float) -> Trial:
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


def _details(
    options: ScrewOptions,
    motion: RegisteredMotion,
    screws: Screws,
    crossings: Intersections,
    path: PathFit,
    spread: tuple[FloatArray, FloatArray],
) -> ScrewDetails:
    length = crossings.length[crossings.valid]
    counts = np.bincount(screws.status, minlength=len(REASONS))
    return ScrewDetails(
        chosen=tuple(name for name in ("lag", "cutoff", "degree") if getattr(options, name) is None),
        sampling_interval=step_of(motion),
        screw_angle=float(np.median(screws.angle[screws.valid])),
        axis_angle=float(np.median(np.arcsin(np.minimum(crossings.sine, 1.0)))),
        segment_rms=float(np.sqrt(np.mean(length**2))),
        segment_median=float(np.median(length)),
        fit_rms=path.rms,
        axis_spread=spread[0],
        axis_directions=spread[1].T,
        screws={REASONS[code]: int(counts[code]) for code in range(len(REASONS)) if counts[code] or not code},
        intersections={
            "used": int(crossings.valid.sum()) - path.rejected,
            "too nearly parallel": int((~crossings.valid).sum()),
            "far from the path": path.rejected,
        },
    )


def _clusters(
    tracks: FeatureTracks, motion: RegisteredMotion, position_W: FloatArray
) -> Iterator[tuple[Cluster, FloatArray]]:
    """For each interval its cluster, with the mean centre of mass in the shape's axes, and its scatter (3,) in m."""
    for interval, fitted in zip(motion.intervals, motion.registrations, strict=True):
        valid = fitted.valid
        com_S = np.einsum(
            "nji,nj->ni", fitted.rotation[valid], position_W[interval.frames][valid] - fitted.translation[valid]
        )
        none = np.full(3, np.nan)
        yield (
            Cluster(
                labels=tuple(tracks.labels[index] for index in interval.features),
                features=np.array(interval.features),
                frames=np.arange(interval.start, interval.stop),
                intervals=(interval,),
                points=fitted.shape,
                centre_of_mass=com_S.mean(axis=0) if len(com_S) else none,
                covariance=None,
            ),
            com_S.std(axis=0) if len(com_S) else none,
        )
