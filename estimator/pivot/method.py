"""pivot: the drifting pivot. Bodies from the tracks, one linear least squares, and its refinement with free attitudes.

The attitude of every frame is free, so nothing needs to be known of how the target turns; what is known of the path of
its centre of mass ties the frames together.
"""

import time as clock
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.diagnostics import assessed, clusters_of
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.dynamics.paths import Path, Polynomial, trajectory_of
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.lack_of_fit import lack_of_fit, without_spurious_information
from baryscope.estimator.pivot.refinement import ROUNDING, Pivot, choose_degree, least_variance, refined, start_of
from baryscope.estimator.pivot.tie_points import TiePoints
from baryscope.estimator.registration.clusters import PosedBody, find_bodies
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

BoolArray = NDArray[np.bool_]

MISFIT = 1.5  # variance over that of the registration, from which on the path is said not to fit


def estimate_by_pivot(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass by the drifting pivot.

    Raises:
        InputError: options that do not go together.
        ComputationError: the tracks do not hold what it takes.
    """
    begin = clock.perf_counter()
    found = solve_pivot(tracks, orbit, options)
    position = found.sampled.position(found.solution.x)
    covariance, offsets = without_spurious_information(found, position)
    clusters = clusters_of(found.posed, (body.points for body in found.bodies), offsets)
    return assessed(
        "pivot",
        tracks,
        found.path.name,
        position,
        found.sampled.covariance(covariance),
        clusters,
        weights=np.where(
            tracks.seen & ~found.inliers, np.maximum(found.observations.weight, NEGLIGIBLE), found.observations.weight
        ),
        variance=found.variance,
        options=options,
        begin=begin,
        extra={
            "converged": found.converged,
            "rounds": found.rounds,
            "tie_points": [_tie_described(tie, tracks.labels) for tie in found.tie_points],
        },
        remarks=found.remarks,
    )


def _tie_described(made: TiePoints, labels: tuple[str, ...]) -> dict[str, Any]:
    return {"clusters": list(made.bodies), "features": [labels[index] for index in made.features]}


def solve_pivot(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Pivot:
    """Bodies, path and points at their least squares."""
    trajectory = trajectory_of(options.trajectory, orbit)
    inliers = screen(tracks.position, tracks.seen)
    posed, noise = find_bodies(tracks.position, inliers)
    measured = observations_of(tracks, tracks.seen)
    observations = _restricted(measured, posed, inliers)
    span = (float(tracks.time[0]), float(tracks.time[-1]))
    if trajectory.kind == "polynomial" and trajectory.degree is None:
        degree = choose_degree(posed, observations, tracks.time, span)
        path: Path = Polynomial(degree, *span)
    else:
        path = trajectory.path(orbit, *span, degree=0)
    frames = sum(len(one.body.frames) for one in posed)
    if 3 * frames <= path.size + 3 * len(posed):
        raise ComputationError(
            f"{counted(frames, 'frame shows', 'frames show')} an attitude, too few for {path.name}: "
            f"more than {path.size // 3 + len(posed)} needed"
        )
    sampled = path.at(tracks.time)
    bodies, x = start_of(posed, observations, path, tracks.time)
    found = refined(path, sampled, bodies, x, posed, measured, observations, inliers, options)
    remarks = [_refusal(tie, tracks.labels) for tie in found.refused]
    ratio = found.residual_variance / max(noise, 1e-300) ** 2
    if found.residual_variance > least_variance(measured, ROUNDING):
        if measured.precision is None and ratio > MISFIT:
            remarks.append(
                f"{path.name} does not fit: residuals are {np.sqrt(ratio):.2g} times those of the bodies alone"
            )
        elif remark := lack_of_fit(found, tracks.time):
            remarks.append(remark)
    return replace(found, remarks=tuple(remarks))


def _refusal(tie: TiePoints, labels: tuple[str, ...]) -> str:
    """A remark that features of one name are not the same points."""
    names, (first, second) = ", ".join(labels[index] for index in tie.features), tie.bodies
    by = "it" if len(tie.features) == 1 else "them"
    return f"{names}: not the same in clusters {first} and {second}, which are not tied by {by}"


def _restricted(measured: Observations, posed: tuple[PosedBody, ...], inliers: BoolArray) -> Observations:
    """Only what some body could explain; an outlier keeps a negligible weight, so that its residual is seen."""
    weight = np.zeros_like(measured.weight)
    for one in posed:
        block = np.ix_(one.body.frames, one.body.features)
        weight[block] = measured.weight[block] * np.where(inliers[block], 1.0, NEGLIGIBLE)
    return measured.weighted(weight)
