"""What `ml` answers: the estimate of a maximum, with covariances of all that it claims, and whether it fits."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance, values_for_path
from baryscope.estimator.adjustment.diagnostics import (
    cluster_of,
    covered_by,
    few_frames,
    main_cluster,
    observability_of,
    rejected_by,
    residuals_of,
)
from baryscope.estimator.adjustment.path_noise import predicted_path, process_noise_of
from baryscope.estimator.adjustment.spurious import SpuriousInformation, farthest, spurious_information_columns
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.details import TumbleDetails
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA
from baryscope.estimator.findings import FREE_TUMBLE, UNCHECKED, DisagreeingClusters, ExcessResiduals, Finding
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation, turned_information
from baryscope.estimator.hyperparameters.evidence import conditional, held
from baryscope.estimator.ml.attached import AttachedAxes
from baryscope.estimator.ml.iteration import ROUNDING, turned_by
from baryscope.estimator.ml.jacobians import Jacobians
from baryscope.estimator.ml.maximum import MaximumAPosteriori
from baryscope.estimator.ml.priors import DENSITY
from baryscope.estimator.ml.products import product_errors
from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.burns import untold_durations
from baryscope.estimator.paths.extended_path import factors_of
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.pivot.disagreement import disagreeing_by_tumble
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.prediction import PredictedBody, PredictedPath
from baryscope.estimator.result import Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks, errors_of

FloatArray = NDArray[np.float64]

SIGNIFICANCE = 1e-6  # probability that residuals of a right model exceed those with free attitudes so much


def answer_of(tracks: FeatureTracks, pivot: PivotSolution, best: MaximumAPosteriori, options: PathOptions) -> Estimate:
    """The estimate with a tumble, from the tracks that it explains and the solution of `pivot` for these.

    Without the time it took.
    """
    errors, seen, itself = errors_of(tracks), best.sampled.position(best.x), best.sampled.itself
    origin = itself.position(best.x)
    distance = float(np.linalg.norm(origin, axis=1).max())
    turn = Jacobians.of(best.motion.turn_in_C, tracks.time, best.blocks)
    y, offsets = _covariances(best, turn, [body.features for body in pivot.bodies], distance)
    of_x = y[best.rotation.size :, best.rotation.size :]
    covariance = itself.covariance(of_x)
    clusters = tuple(
        cluster_of(body, best.equations.points[body.features], offset, tracks.labels)
        for body, offset in zip(pivot.bodies, offsets, strict=True)
    )
    main = clusters[main_cluster(clusters)].features
    attached = AttachedAxes.of(best.equations, y, main, best.variance)
    weight = best.observations.weight
    turned = turned_by(best.sampled, best.x)
    attitude = best.motion.attitude if turned is None else exp_rotation(turned) @ best.motion.attitude
    residuals = tracks.position - (best.seen_points @ np.swapaxes(attitude, 1, 2) + seen[:, None])
    gravity_gradient = best.rotation.orbit is not None
    span, prior, own = (float(tracks.time[0]), float(tracks.time[-1])), best.priors.own, best.posterior
    of_path = predicted_path(best.path, best.x, of_x, span, prior, own)
    answer = Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=origin,
        covariance=covariance,
        motion=_motion(best, turn, attached, of_path, tracks.time),
        observability=observability_of(clusters, covariance),
        clusters=clusters,
        noise=Noise(
            options.sigma, float(np.sqrt(best.residual_variance)), tracks.covariance is not None, pivot.lasting
        ),
        residuals=residuals,
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by(clusters, len(tracks.time)),
        converged=best.converged,
        rounds=best.rounds,
        findings=_findings(best, pivot) + _excess_residuals(residuals, best, pivot, errors),
        method="ml",
        path=pivot.path.name,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=_details(best, attached, pivot.slip.deviation),
        wall_time=0.0,
        forces=factors_of(best.path, best.x, of_x),
        process_noise=process_noise_of(best.path, itself, best.x, prior, own, options.process_noise, pivot.slip),
        predictor=PredictedBody(
            path=of_path,
            rotation=best.rotation,
            covariance=y,
            labels=tracks.labels,
            points=best.equations.points,
            points_covariance=best.variance * best.equations.points_covariance,
            by_unknowns=best.equations.by_unknowns,
            attached=main,
            torque_density=_torque_density(best, options),
        ),
    )
    return replace(answer, findings=answer.findings + disagreeing_by_tumble(pivot, answer, tracks))


def _findings(best: MaximumAPosteriori, pivot: PivotSolution) -> tuple[Finding, ...]:
    """The findings of `pivot`, but for what a tumble does not need: as many frames, attitudes better than noise, and
    clusters that agree by free attitudes.
    """
    others = tuple(one for one in pivot.findings if not isinstance(one, UNCHECKED | DisagreeingClusters))
    return others + few_frames(best.observations.weight, best.unknowns, pivot.lasting)


def _excess_residuals(
    residual: FloatArray, best: MaximumAPosteriori, pivot: PivotSolution, errors: SharedErrors | None
) -> tuple[Finding, ...]:
    """A finding if the residuals (n, m, 3) of ml are greater than with free attitudes by more than noise explains.

    Both are compared where `pivot` uses observations, with the same weights (F test of the two nested models). Noise of
    the camera's attitude, or of the position, is in the first, but not in the second: there is no test then. Of errors
    that last there are fewer values.
    """
    if pivot.slip.variance > 0 or (errors is not None and errors.noisy):
        return ()
    free = pivot.observations
    weight = np.minimum(free.weight, best.observations.weight)
    own = residuals_of(free.position, pivot.bodies, pivot.sampled.position(pivot.solution.x))
    used = np.isfinite(own[..., 0]) & (weight > 0)
    weight = np.where(used, weight, 0.0)
    cost, free_cost = (
        float(np.vdot(weight, free.squares(np.where(used[..., None], one, 0.0)))) for one in (residual, own)
    )
    dof = values_for_path(pivot.bodies, free.weighted(weight)) - pivot.path_unknowns
    more = 3 * float(weight.sum()) - 3 * np.count_nonzero(weight.any(axis=0)) - best.unknowns - dof
    if more <= 0 or dof <= 0 or cost <= dof * least_variance(free, ROUNDING):
        return ()
    ratio = (cost - free_cost) / more / (free_cost / dof)
    if fdtrc(more / pivot.lasting, dof / pivot.lasting, max(ratio, 0.0)) > SIGNIFICANCE:
        return ()
    return (ExcessResiduals(FREE_TUMBLE, float(np.sqrt(cost / (dof + more) / (free_cost / dof)))),)


def _motion(
    best: MaximumAPosteriori, turn: Jacobians, attached: AttachedAxes, of_path: PredictedPath, time: FloatArray
) -> Motion:
    """Velocity, attitude and angular rate with their covariances, in attached axes.

    turn: the Jacobian of the attitude, as a rotation vector in C, by the rotation's unknowns.
    """
    size, R = best.rotation.size, best.motion.attitude
    rate = interpolated(best.path.rate_at, best.path.frequency, time)
    by_rate = Jacobians.of(best.motion.rate_sensitivity_in_C, time, best.blocks)
    return Motion(
        velocity=rate.position(best.x),
        velocity_covariance=rate.covariance(attached.y[size:, size:]) + of_path.untold_velocity(time),
        attitude=R,
        attitude_covariance=attached.over_time(turn, R, np.broadcast_to(np.eye(3), R.shape)),
        angular_rate=best.motion.rate,
        angular_rate_covariance=attached.over_time(by_rate, R, cross_matrices(best.motion.rate)),
    )


def _covariances(
    best: MaximumAPosteriori, turn: Jacobians, clusters: list[NDArray[np.intp]], distance: float
) -> tuple[FloatArray, list[FloatArray]]:
    """The covariances of y (q, q) and of the clusters' offsets (3, 3), without spurious information, with products.

    The estimate of a pure spin has a small error of its axis, which adds spurious information on the position along the
    axis, as in `pivot`. Here the attitude errors φ come from those of rate and inertia; the mean of φ over all frames
    that show something only rotates the axes and is subtracted. Elsewhere φ grows without bounds, and tells nothing.
    """
    variance = max(best.variance, 1e-300)
    y = _covariance_of_unknowns(best, distance, variance)
    size, shown = best.rotation.size, np.any(best.observations.weight > 0, axis=1, keepdims=True)
    spread = variance * _spread(turn, best.motion.attitude, y[:size, :size], shown[:, 0])
    spurious = SpuriousInformation.of(turned_information(_position_information(best), spread), RATE_AND_INERTIA)
    of_y, offsets = y, []
    least = variance / max(farthest(best.equations.points[features]) for features in clusters) ** 2
    for features in clusters:
        offset, crossed = best.equations.offset_covariance(y, features)
        of_offset, of_unknowns = spurious_information_columns(offset, crossed, spurious, least)
        offsets.append(variance * (offset + of_offset @ of_offset.T))
        of_y = of_y + of_unknowns @ of_unknowns.T
    if variance <= least_variance(best.observations, ROUNDING):  # errors of rounding have no products
        return variance * of_y, offsets
    # Directions that are not observed answer to no gradient; the deviation that they are given is none of theirs.
    observed = variance * _covariance_of_unknowns(best, 0.0, variance)
    moved, points = product_errors(best, turn, observed, spread, min(offsets, key=np.trace))
    by_burns = observed[:, size:] @ untold_durations(best.path, observed[size:, size:])
    moved = np.concatenate([moved, by_burns], axis=1)
    points = np.concatenate([points, -best.equations.by_unknowns @ by_burns], axis=1)
    for index, features in enumerate(clusters):
        attached = offset_by_points(best.equations.points[features])
        own = attached @ points[(3 * features[:, None] + np.arange(3)).ravel()]
        offsets[index] = offsets[index] + own @ own.T
    return variance * of_y + moved @ moved.T, offsets


def _spread(turn: Jacobians, attitude: FloatArray, covariance: FloatArray, shown: NDArray[np.bool_]) -> FloatArray:
    """The covariances (n, 3, 3) in B of the attitudes' errors less their mean, for that of the rotation's unknowns.

    The mean is that of the frames (n,) that are shown.
    """
    R_B_C = np.swapaxes(attitude, 1, 2)
    mean = turn.mean(np.where(shown[:, None, None], R_B_C, 0.0)) / shown.mean()
    crossed = R_B_C @ turn.times(covariance @ mean.T)
    own = R_B_C @ turn.covariances(covariance) @ attitude + mean @ covariance @ mean.T
    return np.asarray(own - crossed - np.swapaxes(crossed, 1, 2))


def _covariance_of_unknowns(best: MaximumAPosteriori, distance: float, variance: float) -> FloatArray:
    """The covariance (q, q) of y, for weights that are inverse variances.

    The uncertainty of the noise densities is that of the posterior, in which unobserved directions are not as wide.
    """
    own, found = best.priors, best.posterior
    linear = own.linear(best.equations, own.values(best.rotation, best.x), variance)
    prior = variance * (own.information + np.diag(held(linear, own.own, found.theta)[0]))
    y = best.equations.covariance(best.sampled.itself, distance / np.sqrt(variance), prior)
    if len(found.theta) or own.own.alternatives:
        y = y + (found.about_likeliest - conditional(linear, own.own, found.theta)[1]) / variance
    return np.asarray(y)


def _position_information(best: MaximumAPosteriori) -> FloatArray:
    """Each frame's information on its position for a known attitude, (n, 3, 3) in B, in the weights' units."""
    observations = best.observations
    if observations.precision is None:
        return np.asarray(observations.weight.sum(axis=1)[:, None, None] * np.eye(3))
    total = np.einsum("km,kmij->kij", observations.weight, observations.precision)
    return np.asarray(np.swapaxes(best.motion.attitude, 1, 2) @ total @ best.motion.attitude)


def _torque_density(best: MaximumAPosteriori, options: PathOptions) -> float:
    """The expected density of the torque noise ahead, rad²/s³."""
    if not isinstance(options.torque_noise, str):
        return options.torque_noise
    index = best.priors.own.index(DENSITY)
    return 0.0 if index is None else float(best.posterior.expectation[index])


def _details(best: MaximumAPosteriori, attached: AttachedAxes, slip: float) -> TumbleDetails:
    """The rotational state at the epoch, with standard deviations in attached axes; slip: of the position."""
    rotation, found = best.rotation, best.posterior
    index = best.priors.own.index(DENSITY)
    return TumbleDetails(
        epoch=rotation.epoch,
        attitude=rotation.attitude,
        angular_rate=rotation.rate,
        angular_rate_deviation=np.sqrt(np.diag(attached.of_rate(rotation.rate))),
        inertia=rotation.inertia,
        inertia_deviation=float(np.sqrt(np.trace(attached.of_inertia(rotation.inertia)))),
        gravity_gradient=rotation.orbit is not None,
        torque_noise=None if index is None else float(np.exp(found.theta[index])),
        torque_noise_bounds=None if index is None else found.bounds(index),
        position_noise=slip,
    )
