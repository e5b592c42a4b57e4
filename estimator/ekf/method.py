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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import cluster_of, covered_by, observability_of, rejected_by
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.details import FilterDetails
from baryscope.estimator.dynamics.trajectory import trajectory_of
from baryscope.estimator.ekf.linearised import points_from
from baryscope.estimator.ekf.passes import Passes, passes
from baryscope.estimator.ekf.prediction import PredictedTumble
from baryscope.estimator.ekf.problem import Problem
from baryscope.estimator.ekf.solution import Gaussian
from baryscope.estimator.ekf.spurious import attached_offset, spurious_growth
from baryscope.estimator.ekf.start import Start, starts
from baryscope.estimator.geometry.gauge import turn_by_points
from baryscope.estimator.options import PathOptions, torques_of
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise, ProcessNoise
from baryscope.estimator.tracks import FeatureTracks, FloatArray, IntArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

ORDERS = (1, 2, 3, 4, 5)  # of the noisy derivative of the path, if the path model is not given
BEHIND = 10.0  # of the logarithm of the evidence: an order that far behind another one does not count
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
    _refuse_forces(options)
    trajectory = trajectory_of(options.trajectory, orbit)
    torques = torques_of(orbit, options)
    measured, rounds = observations_of(tracks, tracks.seen), Rounds(progress)
    on_orbit = trajectory.kind == "relative-orbit"
    span, known = (float(tracks.time[0]), float(tracks.time[-1])), options.acceleration
    motion = trajectory.path(orbit, *span, known) if on_orbit else None
    thrusted = None if on_orbit or known is None else trajectory.path(orbit, *span, known)
    orders: tuple[int, ...] = (1,)
    if not on_orbit:
        orders = ORDERS if trajectory.degree is None else (trajectory.degree,)
        if trajectory.degree is None and not isinstance(options.process_noise, str):
            orders = (1,)  # a given density is one of the acceleration

    def solved(start: Start) -> tuple[Start, list[Passes]]:
        _refuse_effort(len(start.nodes.time), tracks.seen.shape[1])
        rounds.did(0.5)
        given = tracks, options, measured, start
        return start, _converged([Problem(*given, order, motion, rounds, thrusted) for order in orders])

    start, found = _first_of(starts(tracks, measured, orbit, options, torques), solved)
    return _result(tracks, options, start, on_orbit, found, begin)


def _refuse_forces(options: PathOptions) -> None:
    """Check that what is told of forces is known.

    Raises:
        InputError: a constant acceleration to be estimated, or a known one with errors of its scale or firings.
    """
    if options.constant_acceleration != "none":
        raise InputError("constant_acceleration: found with ekf, expected pivot or ml")
    known = options.acceleration
    if known is not None and (known.scale > 0 or known.firing > 0):
        raise InputError("acceleration: errors of its scale or firings found with ekf, expected none, or pivot or ml")


def _first_of(
    candidates: Iterator[Start], solved: Callable[[Start], tuple[Start, list[Passes]]]
) -> tuple[Start, list[Passes]]:
    """The result of the first start that leads to one.

    Raises:
        ComputationError: none does; that of the last.
    """
    failure: ComputationError | None = None
    for start in candidates:
        try:
            return solved(start)
        except ComputationError as error:
            failure = error
    assert failure is not None  # noqa: S101  there is at least one start
    raise failure


def _converged(problems: list[Problem]) -> list[Passes]:
    """The results for the orders of the path that converge, ordered by their evidence, else the first one.

    Higher orders than two that are far behind a lower one are not tried.

    Raises:
        ComputationError: all diverge.
    """
    found: list[Passes] = []
    behind = 0
    for index, problem in enumerate(problems):
        try:
            found.append(passes(problem))
        except ComputationError:
            if index == len(problems) - 1 and not found:
                raise
        ranked = _ranked(found)
        far = ranked and (found[-1].problem is not problem or not found[-1].converged or ranked[found[-1]] < -BEHIND)
        behind = behind + 1 if far else 0
        if behind == 2:
            break
    return [one for one, behind in _ranked(found).items() if behind > -BEHIND] or found[:1]


def _ranked(found: list[Passes]) -> dict[Passes, float]:
    """Those that have converged, by their evidence for the least variance of any, and its logarithm less the best's."""
    converged = [one for one in found if one.converged]
    variance = min((one.last.variance for one in converged), default=1.0)
    evidence = {one: one.evidence(variance) for one in converged}
    best = max(evidence.values(), default=0.0)
    return {one: evidence[one] - best for one in sorted(converged, key=lambda one: -evidence[one])}


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


@dataclass(frozen=True, eq=False)
class _Answer:
    """The path at the frames for one order, or the mean of several: position and velocity (n, 3); offset (3,) of the
    features' centroid from the centre of mass, in axes attached to the points.
    """

    position: Gaussian
    velocity: Gaussian
    offset: Gaussian


def _result(
    tracks: FeatureTracks, options: PathOptions, start: Start, on_orbit: bool, orders: list[Passes], begin: float
) -> Estimate:
    """The result of the most probable order, with the mean path of all of them."""
    found, frames = orders[0], start.nodes.frames
    last, at, features = found.last, found.reference, _features(found)
    relative = _ranked(orders)
    probability = np.exp([relative.get(one, 0.0) for one in orders])
    probability /= probability.sum()
    answers = [_answer(one, start) for one in orders]
    answer = _Answer(
        position=Gaussian.mixture((one.position for one in answers), probability),
        velocity=Gaussian.mixture((one.velocity for one in answers), probability),
        offset=Gaussian.mixture((one.offset for one in answers), probability),
    )
    cluster = _cluster(tracks, at.points[features], features, last.weight, answer)
    weight = np.where(tracks.seen, np.maximum(last.weight, NEGLIGIBLE), 0.0)
    order, gravity_gradient = at.deviation.shape[1] // 3 - 1, start.rotation.orbit is not None
    on_polynomial = f"polynomial:{order}" if order else "fixed"
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=answer.position.mean,
        covariance=answer.position.covariance,
        motion=_motion(found, start, features, answer),
        observability=observability_of([cluster], answer.position.covariance),
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
            log_likelihood=found.evidence(found.last.variance),
            final_covariance=answer.position.covariance[-1],
            angular_rate=at.rate[frames[-1]],
            inertia=at.inertia,
        ),
        wall_time=clock.perf_counter() - begin,
        process_noise=_process_noise(found, options, order),
        predictor=PredictedTumble(tuple(orders), probability, tracks.labels, features),
    )


def _process_noise(found: Passes, options: PathOptions, order: int) -> ProcessNoise | None:
    """The process noise of the path; None of a derivative above the acceleration, which has another unit."""
    best, on_position = found.last.member, order == 0
    if options.process_noise == "none":
        return ProcessNoise("none", 0.0, of_position=on_position)
    if order > 1:
        return None
    if not isinstance(options.process_noise, str):
        return ProcessNoise("given", options.process_noise, of_position=on_position)
    scores = {} if found.last.bank is None else found.last.bank.scores
    least = scores.get(replace(best, path=0.0))
    return ProcessNoise(
        "estimated",
        best.path,
        _bounds([member.path for member in found.members], found.probability),
        None if least is None else 2 * max(scores[best] - least, 0.0),
        of_position=on_position,
    )


def _bounds(densities: list[float], probability: FloatArray) -> tuple[float, float]:
    """The least and greatest densities whose probability on either side is at least CREDIBLE."""
    order = np.argsort(densities)
    below = np.cumsum(probability[order])
    ends = np.searchsorted(below, [CREDIBLE, 1 - CREDIBLE]).clip(max=len(order) - 1)
    lower, upper = (float(densities[int(order[end])]) for end in ends)
    return lower, upper


def _features(found: Passes) -> IntArray:
    """The features that are observed."""
    return np.asarray(np.nonzero((found.last.observations.weight > NEGLIGIBLE).any(axis=0))[0])


def _answer(found: Passes, start: Start) -> _Answer:
    """The path for one order, with covariances without spurious information."""
    at, frames, solution, features = found.reference, start.nodes.frames, found.solution, _features(found)
    p = at.deviation.shape[1]
    offset, attached, least = attached_offset(found, features)
    of_offset, growth = spurious_growth(solution, found.last.system, found.last.variance, attached, least)
    points, growth = slice(points_from(p) - 1, None), growth[frames, :p]
    of_path = solution.of_state[frames, :p, :p] + growth @ np.swapaxes(growth, 1, 2)
    H, H_rate = at.path.observed[frames], at.path.observed_rate[frames]
    speed = at.path.nominal_rate[frames] + (H_rate @ at.deviation[frames, :, None])[:, :, 0]
    of_points = attached @ solution.of_theta[points, points] @ attached.T
    return _Answer(
        Gaussian(at.origin[frames], H @ of_path @ np.swapaxes(H, 1, 2)),
        Gaussian(speed, H_rate @ of_path @ np.swapaxes(H_rate, 1, 2)),
        Gaussian(offset, of_points + of_offset @ of_offset.T),
    )


def _motion(found: Passes, start: Start, features: IntArray, answer: _Answer) -> Motion:
    """Velocity of the centre of mass, and attitude and rate of axes that are attached to some features' points."""
    at, frames, solution = found.reference, start.nodes.frames, found.solution
    p = at.deviation.shape[1]
    points, of_state = slice(points_from(p) - 1, None), solution.of_state[frames]
    turn = np.zeros((3, 3 * len(at.points)))
    turn.reshape(3, -1, 3)[:, features] = turn_by_points(at.points[features]).reshape(3, -1, 3)
    crossed = solution.crossed[frames, p : p + 3, points] @ turn.T
    of_turn = turn @ solution.of_theta[points, points] @ turn.T
    return Motion(
        velocity=answer.velocity.mean,
        velocity_covariance=answer.velocity.covariance,
        attitude=at.attitude[frames],
        attitude_covariance=of_state[:, p : p + 3, p : p + 3] + crossed + np.swapaxes(crossed, 1, 2) + of_turn,
        angular_rate=at.rate[frames],
        angular_rate_covariance=of_state[:, p + 3 :, p + 3 :],
    )


def _cluster(
    tracks: FeatureTracks, points: FloatArray, features: IntArray, weight: FloatArray, answer: _Answer
) -> Cluster:
    """All features as one cluster, with the mean offset."""
    frames = np.nonzero((weight > NEGLIGIBLE).sum(axis=1) >= 3)[0]
    intervals = cut_intervals(tracks.seen, np.zeros(len(tracks.time) - 1, dtype=bool))
    moved = points - points.mean(axis=0) + answer.offset.mean
    body = Body(features, frames, moved, np.empty((0, 3, 3)), intervals)
    return cluster_of(body, moved, answer.offset.covariance, tracks.labels)
