"""ekf: an iterated extended Kalman filter with smoother, after Segal, Carmi and Gurfil (IEEE TCST 2014).

Its state is the relative path, the target's attitude, rate and inertia, and its features in body axes. Segal et al.
choose among a bank of inertias by likelihood. Here the bank is one of process noises of path and rotation, and the
inertia is estimated: five coefficients of the logarithm of the second moments of the mass in INERTIA_BASIS.

Three extensions make the comparison fair, and the filter no longer causal. It starts from a registration of all frames.
It is iterated: each pass is linearised about the smoothed motion of the one before (Bell 1994), over all frames at
once. The process noises are those of the greatest likelihood of the innovations, and the result is the mean over the
probable ones. Where passes do not come to rest, others start from the tumble that `ml` finds. Without an orbit the path
is `pivot`'s, a smooth one with a prior, and white acceleration.
"""

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import (
    REJECTED,
    cluster_of,
    covered_by,
    few_frames,
    observability_of,
    rejected_by,
)
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.details import FilterDetails
from baryscope.estimator.dynamics.burns import burned_in
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.trajectory import highest_degree, trajectory_of
from baryscope.estimator.ekf.linearised import INERTIA, PATH, RATE, TURN
from baryscope.estimator.ekf.passes import Passes, passes
from baryscope.estimator.ekf.prediction import PredictedTumble
from baryscope.estimator.ekf.problem import Problem
from baryscope.estimator.ekf.products import product_gradient
from baryscope.estimator.ekf.spurious import attached_offset, growth, spurious_growth
from baryscope.estimator.ekf.start import Start, start_of, starts
from baryscope.estimator.geometry.gauge import turn_by_points
from baryscope.estimator.ml.search import likeliest_tumble
from baryscope.estimator.options import PathOptions, torques_of
from baryscope.estimator.pivot.burns import SIGNIFICANT, unknown_burns
from baryscope.estimator.pivot.method import solve_pivot
from baryscope.estimator.pivot.refinement import Pivot
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.result import Cluster, Estimate, FewFrames, Motion, Noise, ProcessNoise, UnknownBurn
from baryscope.estimator.tracks import FeatureTracks, FloatArray, IntArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

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
    trajectory, span = trajectory_of(options.trajectory, orbit), (float(tracks.time[0]), float(tracks.time[-1]))
    path, on_orbit = trajectory.path(orbit, *span, options.acceleration), trajectory.kind == "relative-orbit"
    measured, rounds = observations_of(tracks, tracks.seen), Rounds(progress)
    solved = _least_squares(tracks, orbit, options, path)
    if solved is not None:
        trajectory = replace(trajectory, highest=highest_degree(solved.path))
        path = _with_burns_of(solved, trajectory.path(orbit, *span, options.acceleration))
    theta = np.array([_found(solved, one.name) for one in path.prior.hyperparameters])

    def followed(start: Start, tracks: FeatureTracks = tracks, measured: Observations = measured) -> Passes:
        _refuse_effort(len(start.nodes.frames), len(start.nodes.time), tracks.seen.shape[1])
        rounds.did(0.5)
        return passes(Problem(tracks, options, measured, start, path, on_orbit, theta, rounds))

    def better() -> Passes | None:
        """From the tumble that `ml` finds: its steps are damped, and arrive from where passes do not."""
        try:
            whole = solved if path.prior.hyperparameters and solved else solve_pivot(tracks, orbit, options)
            points, _, best = likeliest_tumble(tracks, whole, torques, options, rounds)
            found = followed(start_of(points, best), points, observations_of(points, points.seen))
        except ComputationError:
            return None
        return found if found.converged else None

    torques = torques_of(orbit, options)
    try:
        found = _first_of(starts(tracks, measured, solved, torques), followed)
    except ComputationError:
        if (other := better()) is None:
            raise
        found = other
    if not found.converged:
        found = better() or found
    if on_orbit:
        found = _with_unknown_burns(found, orbit)
    return _result(found, begin)


def _with_unknown_burns(found: Passes, orbit: Orbit | None) -> Passes:
    """The passes with the burns that `pivot` finds among the path's unknowns, if there may be any."""
    problem = found.problem
    options, noise = problem.options, _process_noise(found)
    if options.unknown_burns == "none" or (noise.significance or 0.0) < SIGNIFICANT:
        return found
    try:
        burned = _with_burns_of(solve_pivot(problem.tracks, orbit, options), problem.path)
        return found if burned is problem.path else passes(replace(problem, path=burned))
    except ComputationError:
        return found


def _with_burns_of(solved: Pivot, path: Path) -> Path:
    """The path with the burns of a solution of `pivot`, if it has any."""
    burned = burned_in(solved.path)
    if burned is None:
        return path
    return replace(burned, base=path, about=None if burned.about is None else burned.about[: path.size])


def _least_squares(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, path: Path) -> Pivot | None:
    """The solution of `pivot`, for the hyperparameters of a smooth path, or for attitudes of weighted observations.

    None if neither is needed, or if there is no solution for the latter. A registration weighs all points alike, so
    that its attitudes are noisier than the observations' covariances tell.

    Raises:
        ComputationError: the hyperparameters are not to be had.
    """
    if path.prior.hyperparameters:
        return solve_pivot(tracks, orbit, options)
    if tracks.covariance is None:
        return None
    try:
        return solve_pivot(tracks, orbit, replace(options, process_noise="none", sigma=None))
    except ComputationError:
        return None


def _found(solved: Pivot | None, name: str) -> float:
    """A hyperparameter of the path's prior."""
    assert solved is not None  # noqa: S101  as the prior has hyperparameters
    index = solved.path.prior.index(name)
    assert index is not None  # noqa: S101  its path is this one, with noise
    return float(solved.posterior.theta[index])


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


def _first_of(candidates: Iterator[Start], followed: Callable[[Start], Passes]) -> Passes:
    """The passes from the first start that leads anywhere.

    Raises:
        ComputationError: none does; that of the last.
    """
    failure: ComputationError | None = None
    for start in candidates:
        try:
            return followed(start)
        except ComputationError as error:
            failure = error
    assert failure is not None  # noqa: S101  there is at least one start
    raise failure


def _refuse_effort(frames: int, nodes: int, features: int) -> None:
    """Check that the filter's matrices are not too large.

    Raises:
        ComputationError: they are.
    """
    memory = 8.0 * nodes * 60 * (3 * features + 30)
    if features > MAX_FEATURES or memory > MAX_MEMORY:
        between = f", and {counted(nodes - frames, 'node')} in gaps between them," if nodes > frames else ""
        raise ComputationError(
            f"{counted(frames, 'frame')} of {counted(features, 'feature')}{between}: a filter of so many would take "
            f"{memory / 1e9:.2g} GB; use at most {MAX_FEATURES} features and a shorter part, or the method pivot",
            Reason.TOO_LARGE,
        )


@dataclass(frozen=True, eq=False)
class _Answer:
    """Position and velocity (n, 3) at the frames, and the offset (3,) of the features' centroid from the centre of mass
    in axes attached to the points; with covariances without spurious information. products (q, k): of errors.
    """

    position: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    velocity_covariance: FloatArray
    offset: FloatArray
    offset_covariance: FloatArray
    products: FloatArray


def _result(found: Passes, begin: float) -> Estimate:
    problem, last, at, features = found.problem, found.last, found.reference, _features(found)
    tracks, options, start = problem.tracks, problem.options, problem.start
    answer = _answer(found, features)
    cluster = _cluster(tracks, at.points[features], features, last.weight, answer)
    weight = np.where(tracks.seen, np.maximum(last.weight, NEGLIGIBLE), 0.0)
    gravity_gradient = start.rotation.orbit is not None
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=answer.position,
        covariance=answer.covariance,
        motion=_motion(found, features, answer),
        observability=observability_of([cluster], answer.covariance),
        clusters=(cluster,),
        noise=Noise(options.sigma, float(np.sqrt(last.residual_variance)), tracks.covariance is not None),
        residuals=np.where(tracks.seen[..., None], tracks.position - at.seen_at(start.nodes), np.nan),
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by([cluster], len(tracks.time)),
        converged=found.converged,
        rounds=found.count,
        findings=_burns(found) + _few_frames(found),
        method="ekf",
        path=problem.path.name,
        options=replace(options, torque="gravity-gradient" if gravity_gradient else "none"),
        details=FilterDetails(
            process_noise=last.member.path,
            process_noise_bounds=_bounds([member.path for member in found.members], found.probability),
            torque_noise=last.member.turn,
            torque_noise_bounds=_bounds([member.turn for member in found.members], found.probability),
            gravity_gradient=gravity_gradient,
            nis=last.residual_variance / last.variance,
            log_likelihood=-0.5 * (last.parameters.log_determinant + last.parameters.squares / last.variance),
            final_covariance=answer.covariance[-1],
            angular_rate=at.rate[start.nodes.frames[-1]],
            inertia=at.inertia,
        ),
        wall_time=clock.perf_counter() - begin,
        process_noise=_process_noise(found),
        predictor=PredictedTumble(found, tracks.labels, features, answer.products),
    )


def _burns(found: Passes) -> tuple[UnknownBurn, ...]:
    """The findings of burns among the path's unknowns."""
    own = slice(INERTIA, INERTIA + found.problem.path.size)
    return unknown_burns(found.problem.path, found.shift + found.reference.x, found.solution.of_theta[own, own])


def _few_frames(found: Passes) -> tuple[FewFrames, ...]:
    """A finding if there are too few frames for what the tracks tell of path, rate and inertia."""
    last = found.last
    own = slice(last.system.points.start)
    held = np.vdot(last.prior.information[own, own], last.parameters.covariance[own, own])
    return few_frames(last.weight, own.stop - float(held))


def _process_noise(found: Passes) -> ProcessNoise:
    """The process noise of the path."""
    best, on_position, options = found.last.member, found.problem.slips, found.problem.options
    if options.process_noise == "none":
        return ProcessNoise("none", 0.0, of_position=on_position)
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
    """The features of which not all observations are rejected."""
    return np.asarray(np.nonzero((found.last.observations.weight >= REJECTED).any(axis=0))[0])


def _answer(found: Passes, features: IntArray) -> _Answer:
    at, frames, solution, last = found.reference, found.problem.start.nodes.frames, found.solution, found.last
    points = last.system.points
    offset, attached, least = attached_offset(found, features)
    of_offset = attached @ solution.of_theta[points, points] @ attached.T
    spurious, _ = spurious_growth(solution, last.system, last.variance, attached, least)
    noise = found.problem.noise([last.member], last.noise_variance)
    products = product_gradient(last.system, noise, solution, of_offset + spurious @ spurious.T)
    columns, of_states = growth(found, solution, last.system, features, products)
    of_states = of_states[frames, PATH]
    of_path = solution.of_state[frames, PATH, PATH] + of_states @ np.swapaxes(of_states, 1, 2)
    return _Answer(
        at.origin[frames],
        of_path[:, :3, :3],
        at.path.velocity(at.deviation)[frames],
        of_path[:, 3:, 3:] / at.path.span**2,
        offset,
        of_offset + columns @ columns.T,
        products,
    )


def _motion(found: Passes, features: IntArray, answer: _Answer) -> Motion:
    """Velocity of the centre of mass, and attitude and rate of axes that are attached to some features' points."""
    at, frames, solution = found.reference, found.problem.start.nodes.frames, found.solution
    points, of_state = found.last.system.points, solution.of_state[frames]
    turn = np.zeros((3, 3 * len(at.points)))
    turn.reshape(3, -1, 3)[:, features] = turn_by_points(at.points[features]).reshape(3, -1, 3)
    crossed = solution.crossed[frames, TURN, points] @ turn.T
    of_turn = turn @ solution.of_theta[points, points] @ turn.T
    return Motion(
        velocity=answer.velocity,
        velocity_covariance=answer.velocity_covariance,
        attitude=at.attitude[frames],
        attitude_covariance=of_state[:, TURN, TURN] + crossed + np.swapaxes(crossed, 1, 2) + of_turn,
        angular_rate=at.rate[frames],
        angular_rate_covariance=of_state[:, RATE, RATE],
    )


def _cluster(
    tracks: FeatureTracks, points: FloatArray, features: IntArray, weight: FloatArray, answer: _Answer
) -> Cluster:
    """All features as one cluster, with the mean offset."""
    frames = np.nonzero((weight > NEGLIGIBLE).sum(axis=1) >= 3)[0]
    intervals = cut_intervals(tracks.seen, np.zeros(len(tracks.time) - 1, dtype=bool))
    moved = points - points.mean(axis=0) + answer.offset
    body = Body(features, frames, moved, np.empty((0, 3, 3)), intervals)
    return cluster_of(body, moved, answer.offset_covariance, tracks.labels)
