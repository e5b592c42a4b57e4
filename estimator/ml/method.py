"""ml: batch maximum likelihood. Attitude, rate, inertia up to scale, path and points of one tumbling body at once.

It starts from `pivot` and the tumble fitted to its attitudes, and needs no truth. What reaches the bound is that the
attitudes of all frames are three numbers of rate and five of inertia, and that all features belong to one body.
"""

import time as clock
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.diagnostics import cluster_of, covered_by, observability_of, rejected_by
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE, reweighted
from baryscope.estimator.adjustment.spurious import spurious_information_columns, three_sigma_factor
from baryscope.estimator.adjustment.stereo import moved_to, observations_of
from baryscope.estimator.details import TumbleDetails
from baryscope.estimator.dynamics.paths import Path, SampledPath
from baryscope.estimator.dynamics.rotation import INERTIA_BASIS, RATE_AND_INERTIA, Attitudes, Rotation
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.ml.initial_tumble import Tumble, fit_tumble
from baryscope.estimator.ml.likelihood import Equations, equations
from baryscope.estimator.ml.relabelling import relabelled
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.method import MISFIT, solve_pivot
from baryscope.estimator.pivot.refinement import Pivot, least_variance
from baryscope.estimator.result import FREE_TUMBLE, Estimate, ExcessResiduals, Finding, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

ROUNDS = 40
SETTLED = 1e-4  # a step this long, squared, in units of the covariance, is the last
ROUNDING = 1e-7  # of the distance: about what the interpolation of attitudes leaves over
UNRULY = 1e-2  # share of the cost that the last change of weights may take away
SPHERE = 0.5  # of the five numbers of an inertia of trace 1, the deviation from those of a sphere that is expected


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The most likely motion, path and points, and the normal equations there.

    observations with their weights; variance of an observation of weight 1, over the given covariance or in m², as
    given or as the residuals show it; residual_variance: as they show it.
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
    """What is known beforehand, so that what the tracks do not show stays at hand: the rest hardly feels it.

    An inertia is not far from a sphere's, nor a path from that of `pivot` (x0) by more than the target's distance.
    information (q, q): of rate and inertia and x, in the units of the observations' weights.
    """

    information: FloatArray
    x0: FloatArray

    @classmethod
    def of(cls, path: SampledPath, x0: FloatArray, variance: float) -> "_Prior":
        """For observations of weight 1 that have this variance."""
        reach = np.linalg.norm(path.position(x0), axis=1).max()
        inertia = np.eye(RATE_AND_INERTIA - 3) / SPHERE**2
        of_path = np.einsum("kip,kiq->pq", path.jacobian, path.jacobian, optimize=True) / (
            len(path.jacobian) * reach**2
        )
        return cls(variance * block_diag(np.zeros((3, 3)), inertia, of_path), x0)

    def deviation(self, rotation: Rotation, x: FloatArray) -> FloatArray:
        """From what is expected, (q,)."""
        return np.concatenate([np.zeros(3), np.tensordot(INERTIA_BASIS, rotation.inertia), x - self.x0])

    def cost(self, deviation: FloatArray) -> float:
        """What a deviation (q,) costs besides the observations' squares."""
        return float(deviation @ self.information @ deviation)


def estimate_by_likelihood(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass by maximum likelihood.

    Raises:
        InputError: options that do not go together.
        ComputationError: the tracks do not hold what it takes.
    """
    begin = clock.perf_counter()
    torques = _torques(orbit, options)
    tracks, pivot = relabelled(tracks, solve_pivot(tracks, orbit, options))
    noise = max(pivot.variance, least_variance(pivot.observations, ROUNDING))
    tumble = fit_tumble(pivot.bodies, pivot.observations, noise, tracks.time, torques)
    best = _maximised(tracks, pivot, tumble, options)
    origin = best.sampled.position(best.x)
    reach = float(np.linalg.norm(origin, axis=1).max())
    y, offsets = _covariances(best, [body.features for body in pivot.bodies], reach)
    covariance = best.sampled.covariance(y[RATE_AND_INERTIA:, RATE_AND_INERTIA:])
    clusters = tuple(
        cluster_of(body, best.found.points[body.features], offset, tracks.labels)
        for body, offset in zip(pivot.bodies, offsets, strict=True)
    )
    weight = best.observations.weight
    gravity_gradient = best.rotation.orbit is not None
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
        findings=pivot.findings + _misfit(best, pivot),
        method="ml",
        path=pivot.path.name,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=_details(best.rotation, y, gravity_gradient),
        wall_time=clock.perf_counter() - begin,
    )


def _misfit(best: Likelihood, pivot: Pivot) -> tuple[Finding, ...]:
    """Whether residuals are much greater than with attitudes that are free."""
    ratio = best.residual_variance / max(pivot.residual_variance, 1e-300)
    if ratio <= MISFIT or best.residual_variance <= least_variance(pivot.observations, ROUNDING):
        return ()
    return (ExcessResiduals(FREE_TUMBLE, float(np.sqrt(ratio))),)


def _motion(best: Likelihood, y: FloatArray, path: Path, time: FloatArray) -> Motion:
    """Velocity, attitude and angular rate with their covariances from y's, (q, q)."""
    rate, of_rotation = path.rate_at(time), y[:RATE_AND_INERTIA, :RATE_AND_INERTIA]
    turn, by_rate = best.motion.turn, best.rotation.rate_sensitivity_at(time)
    return Motion(
        velocity=rate.position(best.x),
        velocity_covariance=rate.covariance(y[RATE_AND_INERTIA:, RATE_AND_INERTIA:]),
        attitude=best.motion.attitude,
        attitude_covariance=turn @ of_rotation @ np.swapaxes(turn, 1, 2),
        angular_rate=best.motion.rate,
        angular_rate_covariance=by_rate @ of_rotation @ np.swapaxes(by_rate, 1, 2),
    )


def _covariances(
    best: Likelihood, clusters: list[NDArray[np.intp]], reach: float
) -> tuple[FloatArray, list[FloatArray]]:
    """The covariance of y, and those of the clusters' offsets, without what the estimated motion only seems to show.

    A pure spin is estimated with a little wobble, by which a point on its axis seems to be seen: see `pivot`. The turn
    of a frame that rate and inertia leave open is φ; its mean over all frames would turn the axes and show nothing.
    """
    variance = max(best.variance, 1e-300)
    y = best.found.covariance(best.sampled, reach / np.sqrt(variance), best.prior.information)
    turn = best.motion.turn - best.motion.turn.mean(axis=0)
    spread = variance * turn @ y[:RATE_AND_INERTIA, :RATE_AND_INERTIA] @ np.swapaxes(turn, 1, 2)
    known = _known_shifts(best)
    axes = cross_matrices(np.eye(3))
    spurious = three_sigma_factor(RATE_AND_INERTIA) * np.einsum(
        "iba,kbc,jcd,kda->ij", axes, known, axes, spread, optimize=True
    )
    wider, offsets = y, []
    for features in clusters:
        offset, crossed = best.found.offset_covariance(y, features)
        missing, gain = spurious_information_columns(offset, crossed, spurious, variance / reach**2)
        offsets.append(variance * (offset + missing @ missing.T))
        wider = wider + gain @ gain.T
    return variance * wider, offsets


def _known_shifts(best: Likelihood) -> FloatArray:
    """What each frame says of its position when its attitude is known, (n, 3, 3) in B, in the weights' units."""
    observations = best.observations
    if observations.precision is None:
        return np.asarray(observations.weight.sum(axis=1)[:, None, None] * np.eye(3))
    total = np.einsum("km,kmij->kij", observations.weight, observations.precision)
    return np.asarray(np.swapaxes(best.motion.attitude, 1, 2) @ total @ best.motion.attitude)


def _torques(orbit: Orbit | None, options: PathOptions) -> tuple[Orbit | None, ...]:
    """The gravity gradients to try: that of no orbit, of the orbit, or both."""
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    if orbit is None or options.torque == "none":
        return (None,)
    return (orbit,) if options.torque == "gravity-gradient" else (None, orbit)


def _maximised(tracks: FeatureTracks, pivot: Pivot, tumble: Tumble, options: PathOptions) -> Likelihood:
    """Damped Gauss–Newton steps from the pivot's path and the tumble; weights and precisions are renewed as it goes."""
    measured = observations_of(tracks, tracks.seen)
    weight = np.where(tracks.seen, NEGLIGIBLE, 0.0)
    weight = np.where(pivot.observations.weight > 0, pivot.observations.weight, weight)
    observations = measured.weighted(weight)
    points = _common_points(pivot, tumble)
    rotation, x, sampled = tumble.rotation, pivot.solution.x, pivot.sampled
    motion, origin = rotation.at(tracks.time), sampled.position(x)
    stereo = measured.precision is not None and options.noise == "stereo"
    damping, converged, rounds, floor = 1e-6, False, 0, least_variance(measured, ROUNDING)
    prior = _Prior.of(sampled, x, max(pivot.variance, floor))
    found, deviation = equations(observations, motion, sampled, origin, points), prior.deviation(rotation, x)
    while not converged and rounds < ROUNDS:
        rounds += 1
        matrix, rhs = found.matrix + prior.information, found.rhs - prior.information @ deviation
        cost = found.cost + prior.cost(deviation)
        accepted = False
        while not accepted and damping < 1e10:
            change = symmetric_pseudo_inverse(matrix + damping * np.diag(np.diag(matrix))) @ rhs
            turned = rotation.changed(np.zeros(3), change[:RATE_AND_INERTIA])
            if turned.possible and turned.reaches(tracks.time):
                moved = x + change[RATE_AND_INERTIA:]
                new_motion, new_origin = turned.at(tracks.time), sampled.position(moved)
                trial = equations(observations, new_motion, sampled, new_origin, found.points)
                off = prior.deviation(turned, moved)
                accepted = trial.cost + prior.cost(off) <= cost * (1 + 1e-12)
            damping = damping / 30 if accepted else damping * 10
        if not accepted:
            break
        rotation, x, motion, origin, found, deviation = turned, moved, new_motion, new_origin, trial, off
        dof = _dof(observations, len(x))
        variance = max(found.cost / dof, floor)
        step = float(change @ matrix @ change)
        weight = reweighted(found.squares, observations.weight, dof, floor)
        plain = found.squares / np.where(weight > 0, observations.weight, 1.0)
        settled = abs(float(np.vdot(plain, weight)) - found.cost) <= UNRULY * variance * dof
        converged = settled and step <= SETTLED * variance and damping < 1e-2
        if not converged and (stereo or not settled):
            observations = observations.weighted(weight)
            if stereo:
                estimated = found.points @ np.swapaxes(motion.attitude, 1, 2) + origin[:, None]
                observations = moved_to(observations, measured, estimated)
            found = equations(observations, motion, sampled, origin, found.points)
    residual = found.cost / _dof(observations, len(x))
    variance = residual if options.sigma is None else options.sigma**2
    return Likelihood(rotation, motion, x, sampled, found, prior, observations, variance, residual, converged, rounds)


def _dof(observations: Observations, path_size: int) -> float:
    seen = np.count_nonzero(observations.weight.max(axis=0, initial=0.0) > NEGLIGIBLE)
    return max(3 * float(observations.weight.sum()) - 3 * seen - RATE_AND_INERTIA - path_size, 1.0)


def _common_points(pivot: Pivot, tumble: Tumble) -> FloatArray:
    """All features in the axes B of the tumble: those of each body turned there, means where bodies share some."""
    m = pivot.observations.weight.shape[1]
    total, points = np.zeros(m), np.zeros((m, 3))
    for body, R_B_S in zip(pivot.bodies, tumble.bodies, strict=True):
        weight = pivot.observations.weight[np.ix_(body.frames, body.features)].sum(axis=0)
        points[body.features] += weight[:, None] * (body.points @ R_B_S.T)
        total[body.features] += weight
    return np.asarray(points / np.where(total > 0, total, 1.0)[:, None])


def _details(rotation: Rotation, y: FloatArray, gravity_gradient: bool) -> TumbleDetails:
    """The rotational state at the epoch."""
    return TumbleDetails(
        epoch=rotation.epoch,
        attitude=rotation.attitude,
        angular_rate=rotation.rate,
        angular_rate_deviation=np.sqrt(np.diag(y)[:3]),
        inertia=rotation.inertia,
        inertia_deviation=float(np.sqrt(np.trace(y[3:RATE_AND_INERTIA, 3:RATE_AND_INERTIA]))),
        gravity_gradient=gravity_gradient,
    )
