"""ekf: an iterated extended Kalman filter with smoother, after Segal, Carmi and Gurfil (IEEE TCST 2014).

Its state is the relative path, the target's attitude, rate and inertia, and its features in body axes. Segal et al.
choose among a bank of inertias by likelihood. Here the bank is one of process noises of path and rotation, and the
inertia is estimated: five coefficients of its logarithm in INERTIA_BASIS.

Three extensions make the comparison fair, and the filter no longer causal. It starts from a registration of all frames.
It is iterated: each pass is linearised about the smoothed motion of the one before (Bell 1994), over all frames at
once. The process noises are those of the greatest likelihood of the innovations, and the result is the mean over the
probable ones.
"""

import time as clock
from dataclasses import replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import cluster_of, covered_by, observability_of, rejected_by
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.details import FilterDetails
from baryscope.estimator.dynamics.trajectory import trajectory_of
from baryscope.estimator.ekf.linearised import points_from
from baryscope.estimator.ekf.passes import PRIOR_EXTENTS, Passes, Problem, passes
from baryscope.estimator.ekf.spurious import spurious_growth
from baryscope.estimator.ekf.start import Start, start_from
from baryscope.estimator.geometry.gauge import offset_by_points, turn_by_points
from baryscope.estimator.options import PathOptions, refuse_forces
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

ORDERS = (1, 2, 3)  # of the noisy derivative of the path, if the path model is not given
MAX_FEATURES = 200  # all are among the unknowns
MAX_MEMORY = 8e9  # bytes
CREDIBLE = 0.05  # probability on either side of the bounds of a density


def estimate_by_filter(
    tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, progress: Progress = silent
) -> Estimate:
    """The centre of mass by an iterated extended Kalman filter, smoothed.

    The covariance is the smoother's, with the uncertainty of the process noise; `FilterDetails` has the filter's at the
    last frame, the mean normalised innovation squared (1 is expected), and the process noise.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the tracks do not determine the unknowns, or there are too many.
    """
    begin = clock.perf_counter()
    refuse_forces(options, "ekf")
    trajectory = trajectory_of(options.trajectory, orbit)
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    inliers = screen(tracks.position, tracks.seen)
    measured = observations_of(tracks, tracks.seen)
    torques: tuple[Orbit | None, ...] = (None,)
    if orbit is not None and options.torque != "none":
        torques = (orbit,) if options.torque == "gravity-gradient" else (None, orbit)
    rounds = Rounds(progress)
    weight = np.where(tracks.seen, np.where(inliers, 1.0, NEGLIGIBLE), 0.0)
    start = start_from(tracks, inliers, measured.weighted(np.where(inliers, 1.0, 0.0)), torques)
    _refuse_effort(len(start.nodes.time), tracks.seen.shape[1])
    rounds.did(0.5)
    on_orbit = trajectory.kind == "relative-orbit"
    orders: tuple[int, ...] = (1,)
    if not on_orbit:
        orders = ORDERS if trajectory.degree is None else (trajectory.degree,)
        if trajectory.degree is None and not isinstance(options.process_noise, str):
            orders = (1,)  # a given density is one of the acceleration
    found = [
        passes(Problem(tracks, orbit, options, measured, weight, start, order, on_orbit, rounds)) for order in orders
    ]
    best = max(range(len(found)), key=lambda index: found[index].evidence)
    return _result(tracks, options, start, orders[best], on_orbit, found[best], begin)


def _refuse_effort(nodes: int, features: int) -> None:
    """Check that the filter's matrices are not too large.

    Raises:
        ComputationError: they are.
    """
    memory = 8.0 * nodes * 60 * (3 * features + 30)
    if features > MAX_FEATURES or memory > MAX_MEMORY:
        raise ComputationError(
            f"{counted(nodes, 'frame')} of {counted(features, 'feature')}: a filter of so many would take "
            f"{memory / 1e9:.2g} GB; use at most {MAX_FEATURES} features and fewer frames, or the method pivot",
            Reason.TOO_LARGE,
        )


def _result(
    tracks: FeatureTracks,
    options: PathOptions,
    start: Start,
    order: int,
    on_orbit: bool,
    found: Passes,
    begin: float,
) -> Estimate:
    last, at, frames = found.last, found.reference, start.nodes.frames
    p = 3 * (order + 1)
    cluster, growth = _cluster(tracks, start, found)
    growth = growth[frames]
    of_state = found.solution.of_state[frames] + growth @ np.swapaxes(growth, 1, 2)
    H = at.path.observed[frames]
    covariance = H @ of_state[:, :p, :p] @ np.swapaxes(H, 1, 2)
    weight = np.where(tracks.seen, np.maximum(last.weight, NEGLIGIBLE), 0.0)
    gravity_gradient = start.rotation.orbit is not None
    on_polynomial = f"polynomial:{order}" if order else "fixed"
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=at.origin[frames],
        covariance=covariance,
        motion=_motion(found, start, of_state),
        observability=observability_of([cluster], covariance),
        clusters=(cluster,),
        noise=Noise(options.sigma, float(np.sqrt(last.residual_variance)), tracks.covariance is not None),
        residuals=np.where(tracks.seen[..., None], tracks.position - at.seen_at(start.nodes), np.nan),
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by([cluster], len(tracks.time)),
        converged=found.converged,
        rounds=found.count,
        findings=(),
        method="ekf",
        path="relative-orbit" if on_orbit else on_polynomial,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=FilterDetails(
            order=order,
            process_noise=last.member.path,
            process_noise_bounds=_bounds([member.path for member in found.members], found.probability),
            torque_noise=last.member.turn,
            torque_noise_bounds=_bounds([member.turn for member in found.members], found.probability),
            gravity_gradient=gravity_gradient,
            nis=last.residual_variance / last.variance,
            log_likelihood=found.evidence,
            final_covariance=covariance[-1],
            angular_rate=at.rate[-1],
            inertia=at.inertia,
        ),
        wall_time=clock.perf_counter() - begin,
    )


def _bounds(densities: list[float], probability: FloatArray) -> tuple[float, float]:
    """The least and greatest densities whose probability on either side is at least CREDIBLE."""
    order = np.argsort(densities)
    below = np.cumsum(probability[order])
    ends = np.searchsorted(below, [CREDIBLE, 1 - CREDIBLE]).clip(max=len(order) - 1)
    lower, upper = (densities[int(order[end])] for end in ends)
    return lower, upper


def _motion(found: Passes, start: Start, of_state: FloatArray) -> Motion:
    """Velocity of the centre of mass, and attitude and rate of axes that are attached to the points."""
    at, frames = found.reference, start.nodes.frames
    p = at.deviation.shape[1]
    H = at.path.observed_rate[frames]
    points = slice(points_from(p) - 1, None)
    turn = turn_by_points(at.points)
    crossed = found.solution.crossed[frames, p : p + 3, points] @ turn.T
    of_turn = turn @ found.solution.of_theta[points, points] @ turn.T
    return Motion(
        velocity=at.path.nominal_rate[frames] + (H @ at.deviation[frames, :, None])[:, :, 0],
        velocity_covariance=H @ of_state[:, :p, :p] @ np.swapaxes(H, 1, 2),
        attitude=at.attitude[frames],
        attitude_covariance=of_state[:, p : p + 3, p : p + 3] + crossed + np.swapaxes(crossed, 1, 2) + of_turn,
        angular_rate=at.rate[frames],
        angular_rate_covariance=of_state[:, p + 3 :, p + 3 :],
    )


def _cluster(tracks: FeatureTracks, start: Start, found: Passes) -> tuple[Cluster, FloatArray]:
    """All features as one cluster, and columns (n, d, 3) that the states' covariances grow by, see `spurious`."""
    at, last = found.reference, found.last
    features = np.nonzero((last.observations.weight > NEGLIGIBLE).any(axis=0))[0]
    attached = np.zeros((3, 3 * len(at.points)))
    attached.reshape(3, -1, 3)[:, features] = offset_by_points(at.points[features]).reshape(3, -1, 3)
    least = 1 / (PRIOR_EXTENTS * start.radius) ** 2
    of_offset, growth = spurious_growth(found, attached, least)
    points = slice(points_from(at.deviation.shape[1]) - 1, None)
    covariance = attached @ found.solution.of_theta[points, points] @ attached.T + of_offset @ of_offset.T
    used = last.observations.weight > NEGLIGIBLE
    frames = np.nonzero(used.sum(axis=1) >= 3)[0]
    intervals = cut_intervals(tracks.seen, np.zeros(len(tracks.time) - 1, dtype=bool))
    body = Body(features, frames, at.points[features], np.empty((0, 3, 3)), intervals)
    return cluster_of(body, at.points[features], covariance, tracks.labels), growth
