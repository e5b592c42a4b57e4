"""ekf: an iterated extended Kalman filter, after Segal, Carmi and Gurfil (IEEE TCST 2014).

Its state is the relative path, the target's attitude, rate and inertia, and its features in body axes. It starts from
the first frames and processes the tracks frame by frame, as on board a chaser. Segal et al. choose among a bank of
inertias by likelihood. Here the bank is one of process noises, and the inertia is estimated: five coefficients of its
logarithm in INERTIA_BASIS, starting from a sphere. The gravity gradient is a hypothesis of the bank, too.

Three extensions make the comparison fair, and the filter no longer causal. The process noise has the greatest
likelihood of the innovations. The tracks are filtered several times, each pass starting from the last one's result with
ten times its standard deviations, as the first pass linearises about poor initial values. The path is smoothed; without
path noise this propagates the last state back. For long tracks, passes over the first frames choose noise and inertia
before the passes over all frames. A lost attitude, after a gap, is recovered by registration: see `restart`.
"""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import cluster_of, covered_by, observability_of, rejected_by
from baryscope.estimator.adjustment.reweighting import GATE, NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.details import FilterDetails
from baryscope.estimator.dynamics.paths import trajectory_of
from baryscope.estimator.ekf.bank import (
    ORDERS,
    Member,
    bank_noise,
    first_members,
    last_members,
    middle_members,
    next_members,
)
from baryscope.estimator.ekf.effort import refuse_effort
from baryscope.estimator.ekf.filter import ProcessNoise, Run, run_filter
from baryscope.estimator.ekf.guess import Guess, Problem, first_guess, next_guess, renewed_scale
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, derivatives, free_orbit
from baryscope.estimator.ekf.smoother import SmoothedPath, smoothed_path
from baryscope.estimator.ekf.start import start_from
from baryscope.estimator.ekf.state import State
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.options import PathOptions
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit

MAX_PASSES = 8  # over the first frames, and over all frames
FIRST_FRAMES = 200  # with observations, from which the process noise is chosen
MIN_LENGTH = 1.5  # times FIRST_FRAMES, up to which all frames are used at once
MIN_GAIN = 1.0  # of the log-likelihood in a pass, below which the passes have converged
ROUGH_GAIN = 10.0  # the same for the first frames; also the greatest loss of a converged pass
DIVERGED_NIS = 2.0  # mean normalised innovation squared from which the filter counts as diverged


@dataclass(frozen=True, eq=False)
class Pass:
    """A pass over the tracks: its initial values, its best member, the run of that member, and its path."""

    guess: Guess
    member: Member
    run: Run
    path: SmoothedPath

    @property
    def score(self) -> float:
        """Log-likelihood of the innovations, less the penalty of the process noise."""
        return float(self.run.log_likelihood[0]) - self.member.penalty


@dataclass(frozen=True, eq=False)
class Passes:
    """The best of some passes, their number, and whether they converged."""

    best: Pass
    count: int
    converged: bool


def estimate_by_filter(
    tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, progress: Progress = silent
) -> Estimate:
    """The centre of mass by an iterated extended Kalman filter, smoothed.

    The covariance is the smoother's; `FilterDetails` has the filter's own at the last frame, the mean normalised
    innovation squared (1 is expected), and the chosen process noise. Residuals are innovations.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the first frames determine no initial state, or the filter diverges with any process noise.
    """
    begin = clock.perf_counter()
    trajectory = trajectory_of(options.trajectory, orbit)
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    inliers = screen(tracks.position, tracks.seen)
    start = start_from(tracks, inliers)
    refuse_effort(start, tracks)
    on_orbit = trajectory.kind == "relative-orbit"
    problem = Problem(
        tracks,
        orbit,
        options,
        on_orbit,
        1 if on_orbit else trajectory.degree,
        inliers,
        observations_of(tracks, tracks.seen),
        start,
        Rounds(progress),
    )
    return _result(problem, _passes(problem), begin)


def _passes(problem: Problem) -> Passes:
    """Passes until convergence, over the first frames, then over all frames.

    The passes over the first frames choose the process noise and improve the initial values.
    """
    gravity_gradients = [problem.options.torque == "gravity-gradient"]
    if problem.orbit is not None and problem.options.torque is None:
        gravity_gradients = [False, True]
    orders = ORDERS if problem.degree is None else ()
    first, n = problem.start.frame, len(problem.tracks.time)
    observed = first + np.nonzero(problem.inliers[first:].any(axis=1))[0]
    everything, short = range(first, n), len(observed) <= MIN_LENGTH * FIRST_FRAMES
    frames = everything if short else range(first, int(observed[FIRST_FRAMES - 1]) + 1)
    initial = _first_passes(problem, frames, gravity_gradients, orders)
    if initial is None:
        raise _diverged()
    best, count, converged = initial.best, initial.count, initial.converged
    if problem.degree is not None and best.member.path:
        # Errors of the initial inertia may be attributed to noise of the path, which later passes do not correct.
        noiseless = _first_passes(problem, frames, gravity_gradients, orders, noiseless=True)
        if noiseless is not None:
            count += noiseless.count
            if noiseless.best.score > best.score + ROUGH_GAIN:
                best, converged = noiseless.best, noiseless.converged
    if not short:
        whole = _passed(problem, _next(problem, best), middle_members(best.member, orders), everything)
        if whole is None:
            raise _diverged()

        def members(last: Pass, count: int) -> list[Member]:
            noisy = last.member.path > 0 or last.member.turn > 0
            return last_members(last.member, gravity_gradients) if noisy or count == 1 else [last.member]

        last = _repeated(problem, whole, everything, members)
        best, count, converged = last.best, count + last.count, last.converged
    return Passes(_smoothed(problem, best) if best.member.path else best, count, converged)


def _diverged() -> ComputationError:
    return ComputationError(
        "the filter diverges with any process noise: the features do not move as one body", Reason.DIVERGED
    )


def _first_passes(
    problem: Problem,
    frames: range,
    gravity_gradients: list[bool],
    orders: Sequence[int],
    noiseless: bool = False,
) -> Passes | None:
    """Passes from the first initial values, without path noise if `noiseless`. None if all members diverge."""

    def allowed(members: list[Member]) -> list[Member]:
        return [member for member in members if not (noiseless and member.path)]

    first = _passed(problem, first_guess(problem), allowed(first_members(problem.degree)), frames)
    if first is None:
        return None
    return _repeated(
        problem, first, frames, lambda last, _: allowed(next_members(last.member, gravity_gradients, orders))
    )


def _repeated(problem: Problem, last: Pass, frames: range, members: Callable[[Pass, int], list[Member]]) -> Passes:
    """Passes after a first one until convergence, each from the result of the one before."""
    gain = MIN_GAIN if frames.stop == len(problem.tracks.time) else ROUGH_GAIN
    best, count, converged = last, 1, False
    while not converged and count < MAX_PASSES:
        found = _passed(problem, _next(problem, last), members(last, count), frames)
        if found is None:  # the new initial values diverge; the best pass so far remains
            break
        gained = found.score - last.score
        converged = (found.member == last.member or gain > MIN_GAIN) and -ROUGH_GAIN < gained < gain
        best = found if converged or found.score > best.score else best
        last, count = found, count + 1
    return Passes(best, count, converged)


def _next(problem: Problem, last: Pass) -> Guess:
    return next_guess(problem, last.guess, last.run, last.path, last.member.order)


def _passed(problem: Problem, guess: Guess, members: list[Member], frames: range) -> Pass | None:
    """A pass of the bank over the frames; None if all members diverge, or the best one rejects everything."""
    try:
        run, process, noise = _filtered(problem, guess, members, frames, keep=False)
    except ComputationError:  # the initial values are on an open orbit
        return None
    score = run.log_likelihood - [member.penalty for member in members]
    best = int(np.argmax(score))
    if not np.isfinite(score[best]):
        return None
    alone = run.only(best)
    path = smoothed_path(alone.state, process.until(frames.stop), noise.of_path(best), problem.start.frame, ())
    return Pass(guess, members[best], alone, path) if alone.accepted.size and path.regular else None


def _smoothed(problem: Problem, best: Pass) -> Pass:
    """The best member filtered again over all frames, and smoothed with the noise of its path where rounding allows."""
    frames = range(problem.start.frame, len(problem.tracks.time))
    run, process, noise = _filtered(problem, best.guess, [best.member], frames, keep=True)
    if not np.isfinite(run.log_likelihood[0]) or not run.accepted.size:
        return best
    path = smoothed_path(run.state, process, noise.of_path(0), frames.start, run.traces)
    return replace(best, run=run, path=path) if path.regular else best


def _filtered(
    problem: Problem, guess: Guess, members: list[Member], frames: range, keep: bool
) -> tuple[Run, PathProcess, ProcessNoise]:
    start, time = problem.start, problem.tracks.time
    k, m, p = len(members), problem.tracks.seen.shape[1], len(guess.u)
    if problem.on_orbit and problem.orbit is not None:
        process = free_orbit(problem.orbit, time, guess.nominal[:3], guess.nominal[3:], float(time[start.frame]))
    else:
        process = derivatives(p // 3, time, start.centroid)
    speed = float(np.hypot(np.linalg.norm(start.rate), start.rate_deviation))
    noise = bank_noise(members, p // 3, time, speed, problem.orbit)
    P = np.zeros((k, p + ROTATION + 3 * m, p + ROTATION + 3 * m))
    P[:, :p, :p] = guess.covariance
    for member, row in zip(members, P, strict=True):
        row[3 * (member.order + 1) : p] = 0.0
        row[:, 3 * (member.order + 1) : p] = 0.0
    P[:, p + 3 : p + 6, p + 3 : p + 6] = start.rate_deviation**2 * np.eye(3)
    P[:, p + 6 : p + ROTATION, p + 6 : p + ROTATION] = guess.inertia_covariance
    state = State(
        np.tile(guess.u, (k, 1)),
        np.tile([1.0, 0, 0, 0], (k, 1)),
        np.tile(start.rate, (k, 1)),
        np.tile(guess.inertia, (k, 1, 1)),
        np.zeros((k, m, 3)),
        P,
    )
    run = run_filter(state, frames, time, process, noise, guess.measured, keep)
    problem.rounds.did(len(frames) / len(time))
    return run, process, noise


def _result(problem: Problem, passes: Passes, begin: float) -> Estimate:
    best = passes.best
    tracks, run, member = problem.tracks, best.run, best.member
    seen, state, path = tracks.seen, run.state, best.path
    gated = run.squares[0] >= GATE
    weight = np.where(seen, np.where(gated | ~problem.inliers, NEGLIGIBLE, 1.0), 0.0)
    nis, share = float(run.nis[0]), float(gated.sum() / max(np.isfinite(run.squares[0]).sum(), 1))
    cluster, relative = _cluster(problem, best), tracks.covariance is not None
    on_polynomial = f"polynomial:{member.order}" if member.order else "fixed"
    return Estimate(
        time=tracks.time,
        labels=tracks.labels,
        position=path.position,
        covariance=path.position_covariance,
        motion=Motion(velocity=path.velocity, velocity_covariance=path.velocity_covariance),
        observability=observability_of([cluster], path.position_covariance),
        clusters=(cluster,),
        noise=Noise(problem.options.sigma, float(np.sqrt(renewed_scale(best.guess, run))), relative),
        residuals=tracks.position - run.predicted[0],
        used=weight > 0,
        rejected=rejected_by(weight),
        covered=covered_by([cluster], len(tracks.time)),
        converged=passes.converged and nis < DIVERGED_NIS and share < 0.5,
        rounds=passes.count,
        findings=(),
        method="ekf",
        path="relative-orbit" if problem.on_orbit else on_polynomial,
        options=replace(problem.options, torque="gravity-gradient" if member.gravity_gradient else "none"),
        details=FilterDetails(
            order=member.order,
            path_noise=member.path,
            turn_noise=member.turn,
            gravity_gradient=member.gravity_gradient,
            nis=nis,
            restarts=int(run.restarts[0]),
            log_likelihood=float(run.log_likelihood[0]),
            final_covariance=path.position_covariance[-1],
            angular_rate=state.rate[0],
            inertia=state.inertia[0] / np.trace(state.inertia[0]),
        ),
        wall_time=clock.perf_counter() - begin,
    )


def _cluster(problem: Problem, best: Pass) -> Cluster:
    """All initialised features as one cluster."""
    seen, state = problem.tracks.seen, best.run.state
    placed = np.nonzero((seen & problem.inliers)[problem.start.frame :].any(axis=0))[0]
    rows = (len(best.guess.u) + ROTATION + 3 * placed[:, None] + np.arange(3)).ravel()
    points = state.points[0, placed]
    attached, frames = offset_by_points(points), np.nonzero(seen.sum(axis=1) >= 3)[0]
    intervals = cut_intervals(seen, np.zeros(len(seen) - 1, dtype=bool))
    body = Body(placed, frames, points, np.empty((0, 3, 3)), intervals)
    covariance = attached @ state.covariance[0][np.ix_(rows, rows)] @ attached.T
    return cluster_of(body, points, covariance, problem.tracks.labels)
