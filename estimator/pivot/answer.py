"""What `pivot` answers: the estimate of a solution, with the joint covariance of all that it claims."""

import time as clock

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.diagnostics import (
    attitude_series,
    cluster_of,
    covered_by,
    observability_of,
    rejected_by,
    residuals_of,
)
from baryscope.estimator.adjustment.frame_shifts import shifts_in
from baryscope.estimator.adjustment.normal_equations import attitude_covariances, attitude_information
from baryscope.estimator.adjustment.path_noise import predicted_path, process_noise_of
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.details import PivotDetails, TiedClusters
from baryscope.estimator.geometry.symmetric import made_definite
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.extended_path import factors_of
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.seen_path import errors_in, growth_in, of_true_size
from baryscope.estimator.pivot.free_attitudes import MAX_LENGTH, diverged
from baryscope.estimator.pivot.joint_covariance import without_spurious_information
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.ridge import with_ridges
from baryscope.estimator.pivot.tie_points import TiePoints
from baryscope.estimator.pivot.unexplained import following_rotation
from baryscope.estimator.prediction import PredictedPath
from baryscope.estimator.result import Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks, errors_of

FloatArray = NDArray[np.float64]


def estimate_of(found: PivotSolution, tracks: FeatureTracks, options: PathOptions, begin: float) -> Estimate:
    """The estimate for a solution from these tracks; begin: when the work on it began, s of the performance counter.

    Raises:
        ComputationError: the covariance is that of a solution that has diverged.
    """
    errors, x = errors_of(tracks), found.solution.x
    seen, path = found.sampled.position(x), found.sampled.itself
    joint, follows = following_rotation(found, with_ridges(found, without_spurious_information(found)))
    of_x, offsets = joint.of_x, joint.of_offsets
    if errors is not None and errors.scale is not None:
        offsets = _of_true_size(found, errors_in(found.path).start + errors.scale, of_x, offsets)
    covariance = path.covariance(of_x)
    if not np.abs(covariance).max() <= MAX_LENGTH**2:
        raise diverged()
    covariance, growth = made_definite(covariance), growth_in(found.path, errors, x)
    clusters = tuple(
        cluster_of(body, body.points / growth, offset, tracks.labels)
        for body, offset in zip(found.bodies, offsets, strict=True)
    )
    observability = observability_of(clusters, covariance)
    span = (float(tracks.time[0]), float(tracks.time[-1]))
    predictor = predicted_path(found.path, x, of_x, span, found.path.prior, found.posterior)
    weight = found.observations.weight
    weight = np.where(tracks.seen & ~found.inliers, np.maximum(weight, NEGLIGIBLE), weight)
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=path.position(x),
        covariance=covariance,
        motion=_motion(found, predictor, tracks.time, errors),
        observability=observability,
        clusters=clusters,
        noise=Noise(
            options.sigma, float(np.sqrt(found.residual_variance)), tracks.covariance is not None, found.lasting
        ),
        residuals=residuals_of(tracks.position, found.bodies, seen),
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by(clusters, len(tracks.time)),
        converged=found.converged,
        rounds=found.rounds,
        findings=found.findings + follows,
        method="pivot",
        path=found.path.name,
        options=options,
        details=PivotDetails(tuple(_tied(points, tracks.labels) for points in found.tie_points), found.slip.deviation),
        wall_time=clock.perf_counter() - begin,
        forces=factors_of(found.path, x, of_x),
        process_noise=process_noise_of(
            found.path, found.sampled, x, found.path.prior, found.posterior, options.process_noise, found.slip
        ),
        predictor=predictor,
    )


def _of_true_size(found: PivotSolution, scale: int, of_x: FloatArray, offsets: FloatArray) -> FloatArray:
    """The covariances (k, 3, 3) of the bodies' offsets, from those as the camera sees them; scale: its index in x."""
    crossed = found.variance * found.solution.offset_path[:, scale].reshape(-1, 3)
    parts = zip(found.bodies, offsets, crossed, strict=True)
    return np.array(
        [of_true_size(body.points.mean(axis=0), own, c, float(of_x[scale, scale])) for body, own, c in parts]
    )


def _tied(points: TiePoints, labels: tuple[str, ...]) -> TiedClusters:
    return TiedClusters(points.bodies, tuple(labels[index] for index in points.features))


def _motion(found: PivotSolution, of_path: PredictedPath, time: FloatArray, errors: SharedErrors | None) -> Motion:
    """Velocity of the centre of mass, and the attitude of the body with an attitude in the most frames."""
    rate = interpolated(found.path.rate_at, found.path.frequency, time)
    body = max(found.bodies, key=lambda one: len(one.frames))
    attitude_covariance = np.full((len(time), 3, 3), np.nan)
    own = found.observations.features(body.features).frames(body.frames)
    shifts = shifts_in(found.shifts, body.frames)
    information = attitude_information(own, body.attitude, body.points, shifts)
    attitude_covariance[body.frames] = attitude_covariances(information, found.frame_variance)
    if errors is not None:
        attitude, index = attitude_series(body, len(time)), errors_in(found.path)
        turned = errors.attitude_covariance(of_path.covariance[index, index])
        attitude_covariance += np.swapaxes(attitude, 1, 2) @ turned @ attitude
    return Motion(
        velocity=rate.position(found.solution.x),
        velocity_covariance=rate.covariance(of_path.covariance) + of_path.untold_velocity(time),
        attitude=attitude_series(body, len(time)),
        attitude_covariance=attitude_covariance,
    )
