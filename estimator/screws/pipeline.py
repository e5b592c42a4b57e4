"""The way into all screw methods: tracks in, the stages' path out, as an estimate."""

import time as clock
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.details import ScrewDetails
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.screws.motion import RegisteredMotion, step_of
from baryscope.estimator.screws.polynomial import PathFit
from baryscope.estimator.screws.screws import REASONS
from baryscope.estimator.screws.stages import ScrewFunction, Stages, run_stages
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]


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
    stages = run_stages(screws_of, tracks, None if R_C_W is None else np.swapaxes(R_C_W, 1, 2), options)
    motion, path = stages.motion, stages.path
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
        covered=np.isin(np.arange(len(tracks.time)), stages.frames[stages.crossings.valid]),
        converged=all(fitted.converged for fitted in motion.registrations),
        rounds=max(fitted.rounds for fitted in motion.registrations),
        findings=(),
        method=name,
        path=f"polynomial:{path.degree}" if path.degree else "fixed",
        options=replace(options, lag=stages.pairs.lag * step_of(motion), cutoff=stages.cutoff, degree=path.degree),
        details=replace(
            _details(options, stages),
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


def _details(options: ScrewOptions, stages: Stages) -> ScrewDetails:
    screws, crossings, path = stages.screws, stages.crossings, stages.path
    length = crossings.length[crossings.valid]
    counts = np.bincount(screws.status, minlength=len(REASONS))
    return ScrewDetails(
        chosen=tuple(name for name in ("lag", "cutoff", "degree") if getattr(options, name) is None),
        sampling_interval=step_of(stages.motion),
        screw_angle=float(np.median(screws.angle[screws.valid])),
        axis_angle=float(np.median(np.arcsin(np.minimum(crossings.sine, 1.0)))),
        segment_rms=float(np.sqrt(np.mean(length**2))),
        segment_median=float(np.median(length)),
        fit_rms=path.rms,
        axis_spread=stages.spread[0],
        axis_directions=stages.spread[1].T,
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
