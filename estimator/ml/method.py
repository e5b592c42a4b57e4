"""ml: maximum a posteriori estimate of rate, inertia up to scale, path and points of one tumbling body.

It is maximum likelihood with a weak Gaussian prior on the inertia and on the path. A pure spin, or little motion,
leaves the inertia, or a direction of the path, undetermined, and the likelihood alone has no bounded maximum there. The
prior determines these directions. Elsewhere it reduces a variance σ² by about the share (σ/0.5)², for an element of
the inertia of trace 1 with σ much smaller than 0.5. The prior is no part of the Cramér–Rao bound.

The iteration starts from `pivot` and the rotation fitted to its attitudes. The accuracy comes from the model: eight
numbers of rate and inertia determine the attitudes of all frames, and all features belong to one body.
"""

import time as clock
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.diagnostics import (
    cluster_of,
    covered_by,
    main_cluster,
    observability_of,
    rejected_by,
)
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.path_noise import predicted_path, process_noise_of
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, reweighted
from baryscope.estimator.adjustment.spurious import spurious_information_columns, three_sigma_factor
from baryscope.estimator.adjustment.stereo import moved_to, observations_of
from baryscope.estimator.details import TumbleDetails
from baryscope.estimator.dynamics.forces import factors_of
from baryscope.estimator.dynamics.paths import Path, SampledPath
from baryscope.estimator.dynamics.rotation import INERTIA_BASIS, RATE_AND_INERTIA, Attitudes, Rotation
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.ml.initial_tumble import Tumble, fit_tumble
from baryscope.estimator.ml.likelihood import Equations, Model, equations
from baryscope.estimator.ml.relabelling import relabelled
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.method import MAX_VARIANCE_RATIO, solve_pivot
from baryscope.estimator.pivot.refinement import Pivot, least_variance
from baryscope.estimator.prediction import PredictedBody
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.result import FREE_TUMBLE, Estimate, ExcessResiduals, Finding, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

MAX_ROUNDS = 40
STEP_TOLERANCE = 1e-4  # squared length of the last step, in units of the covariance
ROUNDING = 1e-7  # relative to the distance: about the interpolation error of attitudes
WEIGHT_CHANGE_TOLERANCE = 1e-2  # relative change of the cost by the last change of weights
PRIOR_INERTIA_DEVIATION = 0.5  # standard deviation of the prior of the five elements of the inertia of trace 1
STAGE = 0.5  # of the unit of progress, that the start, the tumble and each round take


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The maximum a posteriori estimate of motion, path and points, with the normal equations there.

    observations with their final weights; variance of an observation of weight 1, as given or from the residuals: in
    m², or as a factor on the given covariances; residual_variance: that from the residuals.
    """

    rotation: Rotation
    motion: Attitudes
    x: FloatArray
    sampled: SampledPath
    found: Equations
    prior: "_Prior"
    observations: Observations
    variance: float
    residual_variance: float
    converged: bool
    rounds: int


@dataclass(frozen=True, eq=False)
class _Prior:
    """A weak Gaussian prior on inertia and path, for directions that the tracks do not determine.

    The inertia's mean is a sphere's, with PRIOR_INERTIA_DEVIATION. The path's mean is that of `pivot` (x0), with an rms
    deviation of the target's distance. information (q, q) on (rate and inertia, x), in the units of the weights. The
    path's own prior has the mean zero, and the precision (p,) that `pivot` found, in the same units.
    """

    information: FloatArray
    x0: FloatArray
    precision: FloatArray

    @classmethod
    def of(cls, pivot: Pivot, variance: float) -> "_Prior":
        """The prior for observations of weight 1 with this variance."""
        path, x0 = pivot.sampled, pivot.solution.x
        distance = np.linalg.norm(path.position(x0), axis=1).max()
        inertia = np.eye(RATE_AND_INERTIA - 3) / PRIOR_INERTIA_DEVIATION**2
        of_path = np.einsum("kip,kiq->pq", path.jacobian, path.jacobian, optimize=True) / (
            len(path.jacobian) * distance**2
        )
        information = variance * block_diag(np.zeros((3, 3)), inertia, of_path)
        return cls(information, x0, variance * pivot.precision)

    @property
    def matrix(self) -> FloatArray:
        """The information (q, q) of both priors."""
        return self.information + np.diag(np.concatenate([np.zeros(RATE_AND_INERTIA), self.precision]))

    def rhs(self, rotation: Rotation, x: FloatArray) -> FloatArray:
        """Half of the negative gradient (q,) of the cost."""
        own = np.concatenate([np.zeros(RATE_AND_INERTIA), self.precision * x])
        return np.asarray(-self.information @ self.deviation(rotation, x) - own)

    def deviation(self, rotation: Rotation, x: FloatArray) -> FloatArray:
        """The deviation (q,) of the unknowns from the prior's mean."""
        return np.concatenate([np.zeros(3), np.tensordot(INERTIA_BASIS, rotation.inertia), x - self.x0])

    def cost(self, rotation: Rotation, x: FloatArray) -> float:
        """The priors' contribution to the cost."""
        deviation = self.deviation(rotation, x)
        return float(deviation @ self.information @ deviation + self.precision @ (x * x))


def estimate_by_likelihood(
    tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, progress: Progress = silent
) -> Estimate:
    """The maximum a posteriori estimate of the centre of mass.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the tracks do not determine the unknowns.
    """
    begin, done = clock.perf_counter(), Rounds(progress)
    torques = _torques(orbit, options)
    tracks, pivot = relabelled(tracks, solve_pivot(tracks, orbit, options))
    done.did(STAGE)
    noise = max(pivot.variance, least_variance(pivot.observations, ROUNDING))
    tumble = fit_tumble(pivot.bodies, pivot.observations, noise, tracks.time, torques)
    done.did(STAGE)
    best = _maximised(tracks, pivot, tumble, options, done)
    origin = best.sampled.position(best.x)
    distance = float(np.linalg.norm(origin, axis=1).max())
    y, offsets = _covariances(best, [body.features for body in pivot.bodies], distance)
    of_x = y[RATE_AND_INERTIA:, RATE_AND_INERTIA:]
    covariance = best.sampled.covariance(of_x)
    clusters = tuple(
        cluster_of(body, best.found.points[body.features], offset, tracks.labels)
        for body, offset in zip(pivot.bodies, offsets, strict=True)
    )
    weight = best.observations.weight
    gravity_gradient = best.rotation.orbit is not None
    span, prior, own = (float(tracks.time[0]), float(tracks.time[-1])), pivot.path.prior, pivot.posterior
    path = predicted_path(pivot.path, best.x, y[RATE_AND_INERTIA:, RATE_AND_INERTIA:], span, prior, own)
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=origin,
        covariance=covariance,
        motion=_motion(best, y, pivot.path, tracks.time),
        observability=observability_of(clusters, covariance),
        clusters=clusters,
        noise=Noise(options.sigma, float(np.sqrt(best.residual_variance)), tracks.covariance is not None),
        residuals=tracks.position - (best.found.points @ np.swapaxes(best.motion.attitude, 1, 2) + origin[:, None]),
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by(clusters, len(tracks.time)),
        converged=best.converged,
        rounds=best.rounds,
        findings=pivot.findings + _excess_residuals(best, pivot),
        method="ml",
        path=pivot.path.name,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=_details(best.rotation, y, gravity_gradient),
        wall_time=clock.perf_counter() - begin,
        forces=factors_of(pivot.path, best.x, of_x),
        process_noise=process_noise_of(pivot.path, best.sampled, best.x, prior, own),
        predictor=PredictedBody(
            path,
            best.rotation,
            y,
            tracks.labels,
            best.found.points,
            best.variance * best.found.points_covariance,
            best.found.by_unknowns,
            clusters[main_cluster(clusters)].features,
        ),
    )


def _excess_residuals(best: Likelihood, pivot: Pivot) -> tuple[Finding, ...]:
    """A finding if the residuals are much greater than with free attitudes."""
    ratio = best.residual_variance / max(pivot.residual_variance, 1e-300)
    if ratio <= MAX_VARIANCE_RATIO or best.residual_variance <= least_variance(pivot.observations, ROUNDING):
        return ()
    return (ExcessResiduals(FREE_TUMBLE, float(np.sqrt(ratio))),)


def _motion(best: Likelihood, y: FloatArray, path: Path, time: FloatArray) -> Motion:
    """Velocity, attitude and angular rate with their covariances, from the covariance (q, q) of y."""
    rate, of_rotation = path.rate_at(time), y[:RATE_AND_INERTIA, :RATE_AND_INERTIA]
    turn, by_rate = best.motion.turn, best.motion.rate_sensitivity
    return Motion(
        velocity=rate.position(best.x),
        velocity_covariance=rate.covariance(y[RATE_AND_INERTIA:, RATE_AND_INERTIA:]),
        attitude=best.motion.attitude,
        attitude_covariance=turn @ of_rotation @ np.swapaxes(turn, 1, 2),
        angular_rate=best.motion.rate,
        angular_rate_covariance=by_rate @ of_rotation @ np.swapaxes(by_rate, 1, 2),
    )


def _covariances(
    best: Likelihood, clusters: list[NDArray[np.intp]], distance: float
) -> tuple[FloatArray, list[FloatArray]]:
    """The covariances of y (q, q) and of the clusters' offsets (3, 3), without spurious information.

    The estimate of a pure spin has a small error of its axis, which adds spurious information on the position along the
    axis, as in `pivot`. Here the attitude errors φ come from those of rate and inertia; the mean of φ over all frames
    only rotates the axes and is subtracted.
    """
    variance = max(best.variance, 1e-300)
    y = best.found.covariance(best.sampled, distance / np.sqrt(variance), best.prior.matrix)
    turn = best.motion.turn - best.motion.turn.mean(axis=0)
    spread = variance * turn @ y[:RATE_AND_INERTIA, :RATE_AND_INERTIA] @ np.swapaxes(turn, 1, 2)
    position_information = _position_information(best)
    axes = cross_matrices(np.eye(3))
    spurious = three_sigma_factor(RATE_AND_INERTIA) * np.einsum(
        "iba,kbc,jcd,kda->ij", axes, position_information, axes, spread, optimize=True
    )
    of_y, offsets = y, []
    for features in clusters:
        offset, crossed = best.found.offset_covariance(y, features)
        of_offset, of_unknowns = spurious_information_columns(offset, crossed, spurious, variance / distance**2)
        offsets.append(variance * (offset + of_offset @ of_offset.T))
        of_y = of_y + of_unknowns @ of_unknowns.T
    return variance * of_y, offsets


def _position_information(best: Likelihood) -> FloatArray:
    """Each frame's information on its position for a known attitude, (n, 3, 3) in B, in the weights' units."""
    observations = best.observations
    if observations.precision is None:
        return np.asarray(observations.weight.sum(axis=1)[:, None, None] * np.eye(3))
    total = np.einsum("km,kmij->kij", observations.weight, observations.precision)
    return np.asarray(np.swapaxes(best.motion.attitude, 1, 2) @ total @ best.motion.attitude)


def _torques(orbit: Orbit | None, options: PathOptions) -> tuple[Orbit | None, ...]:
    """The orbits whose gravity-gradient torque is tried; None is no torque.

    Raises:
        InputError: a gravity gradient without an orbit.
    """
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    if orbit is None or options.torque == "none":
        return (None,)
    return (orbit,) if options.torque == "gravity-gradient" else (None, orbit)


def _maximised(tracks: FeatureTracks, pivot: Pivot, tumble: Tumble, options: PathOptions, done: Rounds) -> Likelihood:
    """Damped Gauss–Newton steps from the path of `pivot` and the fitted rotation, with updates of the weights."""
    measured = observations_of(tracks, tracks.seen)
    weight = np.where(tracks.seen, NEGLIGIBLE, 0.0)
    weight = np.where(pivot.observations.weight > 0, pivot.observations.weight, weight)
    observations = measured.weighted(weight)
    points = _common_points(pivot, tumble)
    rotation, x, sampled = tumble.rotation, pivot.solution.x, pivot.sampled
    motion, origin = rotation.at(tracks.time), sampled.position(x)
    stereo = measured.precision is not None and options.noise == "stereo"
    damping, converged, rounds, floor = 1e-6, False, 0, least_variance(measured, ROUNDING)
    prior = _Prior.of(pivot, max(pivot.variance, floor))
    found = equations(observations, Model(motion, sampled, origin, points))
    while not converged and rounds < MAX_ROUNDS:
        rounds += 1
        done.did(STAGE)
        matrix, rhs = found.matrix + prior.matrix, found.rhs + prior.rhs(rotation, x)
        cost = found.cost + prior.cost(rotation, x)
        accepted = False
        while not accepted and damping < 1e10:
            change = symmetric_pseudo_inverse(matrix + damping * np.diag(np.diag(matrix))) @ rhs
            turned = rotation.changed(np.zeros(3), change[:RATE_AND_INERTIA])
            new_motion = turned.try_at(tracks.time) if turned.possible else None
            if new_motion is not None:
                moved = x + change[RATE_AND_INERTIA:]
                new_origin = sampled.position(moved)
                trial = equations(observations, Model(new_motion, sampled, new_origin, found.points))
                accepted = trial.cost + prior.cost(turned, moved) <= cost * (1 + 1e-12)
            damping = damping / 30 if accepted else damping * 10
        if not accepted:
            break
        assert new_motion is not None  # noqa: S101  it was accepted
        rotation, x, motion, origin, found = turned, moved, new_motion, new_origin, trial
        dof = _dof(observations, pivot.path_unknowns)
        variance = max(found.cost / dof, floor)
        step = float(change @ matrix @ change)
        weight = reweighted(found.squares, observations.weight, dof, floor)
        unweighted = found.squares / np.where(weight > 0, observations.weight, 1.0)
        weights_converged = (
            abs(float(np.vdot(unweighted, weight)) - found.cost) <= WEIGHT_CHANGE_TOLERANCE * variance * dof
        )
        converged = weights_converged and step <= STEP_TOLERANCE * variance and damping < 1e-2
        if not converged and (stereo or not weights_converged):
            observations = observations.weighted(weight)
            if stereo:
                estimated = found.points @ np.swapaxes(motion.attitude, 1, 2) + origin[:, None]
                observations = moved_to(observations, measured, estimated)
            found = equations(observations, Model(motion, sampled, origin, found.points))
    residual = found.cost / _dof(observations, pivot.path_unknowns)
    variance = residual if options.sigma is None else options.sigma**2
    return Likelihood(rotation, motion, x, sampled, found, prior, observations, variance, residual, converged, rounds)


def _dof(observations: Observations, path_size: float) -> float:
    seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
    return max(3 * float(observations.weight.sum()) - 3 * seen - RATE_AND_INERTIA - path_size, 1.0)


def _common_points(pivot: Pivot, tumble: Tumble) -> FloatArray:
    """The points (m, 3) of all features in the axes B of the tumble, m; means where bodies share features."""
    m = pivot.observations.weight.shape[1]
    total, points = np.zeros(m), np.zeros((m, 3))
    for body, R_B_S in zip(pivot.bodies, tumble.bodies, strict=True):
        weight = pivot.observations.weight[np.ix_(body.frames, body.features)].sum(axis=0)
        points[body.features] += weight[:, None] * (body.points @ R_B_S.T)
        total[body.features] += weight
    return np.asarray(points / np.where(total > 0, total, 1.0)[:, None])


def _details(rotation: Rotation, y: FloatArray, gravity_gradient: bool) -> TumbleDetails:
    """The rotational state at the epoch, with standard deviations from the covariance of y."""
    return TumbleDetails(
        epoch=rotation.epoch,
        attitude=rotation.attitude,
        angular_rate=rotation.rate,
        angular_rate_deviation=np.sqrt(np.diag(y)[:3]),
        inertia=rotation.inertia,
        inertia_deviation=float(np.sqrt(np.trace(y[3:RATE_AND_INERTIA, 3:RATE_AND_INERTIA]))),
        gravity_gradient=gravity_gradient,
    )
