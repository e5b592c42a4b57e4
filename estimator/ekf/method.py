"""ekf: an iterated extended Kalman filter, in the manner of Segal, Carmi and Gurfil (IEEE TCST 2014).

Its state is the relative path, the target's attitude, rate and inertia, and its features in body axes. It starts from
the first frames alone and goes through the tracks frame by frame, as a chaser would. Where Segal et al. choose among a
bank of inertias by likelihood, the bank here is one of process noises, and the inertia is estimated: five coefficients
of INERTIA_BASIS, of its logarithm, from a sphere on. Gravity gradient or not is a hypothesis, too.

What makes it a strong peer, and no causal filter any more: the process noise is the one of greatest innovation
likelihood; the tracks are filtered several times over, each time from where the last one led, with ten times its
deviations, since the first pass linearises about a poor guess; and the path is smoothed at all times. Where the path's
noise is zero that is the last state carried back. Of long tracks the first frames teach noise and inertia, and only
then come all frames. Where the attitude is lost, after a gap, registration finds it again: see `restart`.
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
from baryscope.estimator.dynamics.rotation import too_long
from baryscope.estimator.ekf.bank import (
    ORDERS,
    Member,
    bank_noise,
    first_members,
    last_members,
    middle_members,
    next_members,
)
from baryscope.estimator.ekf.filter import ProcessNoise, Run, run_filter
from baryscope.estimator.ekf.guess import Guess, Problem, first_guess, next_guess, renewed_scale
from baryscope.estimator.ekf.motion import ROTATION, TURN, PathProcess, derivatives, free_orbit
from baryscope.estimator.ekf.smoother import SmoothedPath, smoothed_path
from baryscope.estimator.ekf.start import Start, start_from
from baryscope.estimator.ekf.state import State
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import cut_intervals
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Cluster, Estimate, Motion, Noise
from baryscope.estimator.tracks import FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit

PASSES = 8  # over the first frames, and over all, at most
LEARN = 200  # of the first frames that show something, by which the process noise is chosen
WORTH = 1.5  # times as many there must be for it to be worth the while
GAIN = 1.0  # of log-likelihood, below which a pass brought nothing
ROUGH_GAIN = 10.0  # the same while there are more frames to come; and what a pass may lose
BRIDGED, PER_FRAME = 30_000, 10  # steps of integration that a pass may take: more would take many minutes
ASTRAY = 2.0  # mean normalised innovation squared from which on the filter counts as diverged


@dataclass(frozen=True, eq=False)
class Pass:
    """A pass over the tracks: its guess, its best member, how that fared (alone in `run`), and its path."""

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
    """The best of some passes, their number, and whether they settled."""

    best: Pass
    count: int
    settled: bool


def estimate_by_filter(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass by an iterated extended Kalman filter, smoothed.

    The covariance is the smoother's; `FilterDetails` has the filter's own at the last frame, the mean normalised
    innovation squared (1 is expected), and the process noise that was chosen. Residuals are innovations.

    Raises:
        InputError: options that do not go together.
        ComputationError: the filter cannot start, or goes astray whatever its process noise.
    """
    begin = clock.perf_counter()
    trajectory = trajectory_of(options.trajectory, orbit)
    if options.torque == "gravity-gradient" and orbit is None:
        raise InputError("torque is gravity-gradient, which needs the target's orbit; expected an orbit")
    inliers = screen(tracks.position, tracks.seen)
    start = start_from(tracks, inliers)
    _refuse_long(start, tracks.time)
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
    )
    best, count, settled = _passes(problem)
    return _result(problem, best, count, settled, begin)


def _refuse_long(start: Start, time: FloatArray) -> None:
    """Check that the target does not turn too often between the frames for its motion to be followed.

    Raises:
        ComputationError: it does.
    """
    span = float(time[-1] - time[start.frame])
    pace = float(np.hypot(np.linalg.norm(start.rate), start.rate_deviation))
    if pace * span > TURN * (BRIDGED + PER_FRAME * len(time)):
        raise too_long(pace, span)


def _passes(problem: Problem) -> tuple[Pass, int, bool]:
    """Passes until these bring nothing more: the best, their number, and whether they settled.

    The first ones go over the first frames only, where the process noise is chosen and a poor guess becomes a good one.
    """
    gravity_gradients = [problem.options.torque == "gravity-gradient"]
    if problem.orbit is not None and problem.options.torque is None:
        gravity_gradients = [False, True]
    orders = ORDERS if problem.degree is None else ()
    first, n = problem.start.frame, len(problem.tracks.time)
    posed = first + np.nonzero(problem.inliers[first:].any(axis=1))[0]
    everything, short = range(first, n), len(posed) <= WORTH * LEARN
    frames = everything if short else range(first, int(posed[LEARN - 1]) + 1)
    learned = _learned(problem, frames, gravity_gradients, orders)
    if learned is None:
        raise _astray()
    best, count, settled = learned.best, learned.count, learned.settled
    if problem.degree is not None and best.member.path:
        # A poor first inertia is easily taken for noise of the path, and no pass finds back from there.
        calm = _learned(problem, frames, gravity_gradients, orders, calm=True)
        if calm is not None:
            count += calm.count
            if calm.best.score > best.score + ROUGH_GAIN:
                best, settled = calm.best, calm.settled
    if not short:
        whole = _passed(problem, _next(problem, best), middle_members(best.member, orders), everything)
        if whole is None:
            raise _astray()

        def members(last: Pass, count: int) -> list[Member]:
            noisy = last.member.path > 0 or last.member.turn > 0
            return last_members(last.member, gravity_gradients) if noisy or count == 1 else [last.member]

        last = _repeated(problem, whole, everything, members)
        best, count, settled = last.best, count + last.count, last.settled
    return (_smoothed(problem, best) if best.member.path else best), count, settled


def _astray() -> ComputationError:
    return ComputationError(
        "the filter goes astray, whatever its process noise: the features do not move as one body", Reason.DIVERGED
    )


def _learned(
    problem: Problem,
    frames: range,
    gravity_gradients: list[bool],
    orders: Sequence[int],
    calm: bool = False,
) -> Passes | None:
    """Passes from a first guess on, with path noise if need be, or calm: without any. None where all go astray."""

    def some(members: list[Member]) -> list[Member]:
        return [member for member in members if not (calm and member.path)]

    first = _passed(problem, first_guess(problem), some(first_members(problem.degree)), frames)
    if first is None:
        return None
    return _repeated(problem, first, frames, lambda last, _: some(next_members(last.member, gravity_gradients, orders)))


def _repeated(problem: Problem, last: Pass, frames: range, members: Callable[[Pass, int], list[Member]]) -> Passes:
    """Passes after a first one, each from where the last one led."""
    gain = GAIN if frames.stop == len(problem.tracks.time) else ROUGH_GAIN
    best, count, settled = last, 1, False
    while not settled and count < PASSES:
        found = _passed(problem, _next(problem, last), members(last, count), frames)
        if found is None:  # what was learnt leads astray; before, something was found
            break
        gained = found.score - last.score
        settled = (found.member == last.member or gain > GAIN) and -ROUGH_GAIN < gained < gain
        best = found if settled or found.score > best.score else best
        last, count = found, count + 1
    return Passes(best, count, settled)


def _next(problem: Problem, last: Pass) -> Guess:
    return next_guess(problem, last.guess, last.run, last.path, last.member.order)


def _passed(problem: Problem, guess: Guess, members: list[Member], frames: range) -> Pass | None:
    """The bank over the frames, and its best member; None where all members go astray."""
    try:
        run, process, noise = _filtered(problem, guess, members, frames, keep=False)
    except ComputationError:  # the guess is on an open orbit
        return None
    score = run.log_likelihood - [member.penalty for member in members]
    best = int(np.argmax(score))
    if not np.isfinite(score[best]):
        return None
    alone = run.only(best)
    path = smoothed_path(alone.state, process.until(frames.stop), noise.of_path(best), problem.start.frame, ())
    return Pass(guess, members[best], alone, path)


def _smoothed(problem: Problem, best: Pass) -> Pass:
    """The same member once more, over all frames, smoothed with the noise of its path."""
    frames = range(problem.start.frame, len(problem.tracks.time))
    run, process, noise = _filtered(problem, best.guess, [best.member], frames, keep=True)
    return replace(best, run=run, path=smoothed_path(run.state, process, noise.of_path(0), frames.start, run.traces))


def _filtered(
    problem: Problem, guess: Guess, members: list[Member], frames: range, keep: bool
) -> tuple[Run, PathProcess, ProcessNoise]:
    start, time = problem.start, problem.tracks.time
    k, m, p = len(members), problem.tracks.seen.shape[1], len(guess.u)
    if problem.on_orbit and problem.orbit is not None:
        process = free_orbit(problem.orbit, time, guess.nominal[:3], guess.nominal[3:], float(time[start.frame]))
    else:
        process = derivatives(p // 3, time, start.centroid)
    pace = float(np.hypot(np.linalg.norm(start.rate), start.rate_deviation))
    noise = bank_noise(members, p // 3, time, pace, problem.orbit)
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
    return run_filter(state, frames, time, process, noise, guess.measured, keep), process, noise


def _result(problem: Problem, best: Pass, count: int, settled: bool, begin: float) -> Estimate:
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
        converged=settled and nis < ASTRAY and share < 0.5,
        rounds=count,
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
    """All features that were placed, as one cluster."""
    seen, state = problem.tracks.seen, best.run.state
    placed = np.nonzero((seen & problem.inliers)[problem.start.frame :].any(axis=0))[0]
    rows = (len(best.guess.u) + ROTATION + 3 * placed[:, None] + np.arange(3)).ravel()
    points = state.points[0, placed]
    held, frames = offset_by_points(points), np.nonzero(seen.sum(axis=1) >= 3)[0]
    intervals = cut_intervals(seen, np.zeros(len(seen) - 1, dtype=bool))
    body = Body(placed, frames, points, np.empty((0, 3, 3)), intervals)
    covariance = held @ state.covariance[0][np.ix_(rows, rows)] @ held.T
    return cluster_of(body, points, covariance, problem.tracks.labels)
