"""ekf: an iterated extended Kalman filter with smoother, after Segal, Carmi and Gurfil (IEEE TCST 2014).

Its state is the relative path, the target's attitude, rate and inertia, and its features in body axes. Segal et al.
choose among a bank of inertias by likelihood. Here the bank is one of process noises of path and rotation, and the
inertia is estimated: five coefficients of the logarithm of the second moments of the mass in INERTIA_BASIS.

Three extensions make the comparison fair, and the filter no longer causal. It starts from a registration of all frames.
It is iterated: each pass is linearised about the smoothed motion of the one before (Bell 1994), over all frames at
once. The process noises are those of the greatest likelihood of the innovations, and the result is the mean over the
probable ones. Where passes do not come to rest, others start from the tumble that `ml` finds. Without an orbit the path
is `pivot`'s, a smooth one with a prior or the motion on the orbit that it estimates, and white acceleration.
"""

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.dynamics.burns import burned_in
from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.relative_motion import orbit_in
from baryscope.estimator.dynamics.trajectory import Trajectory, highest_degree, trajectory_of
from baryscope.estimator.ekf.answer import answer_of, process_noise_of
from baryscope.estimator.ekf.passes import Passes, passes
from baryscope.estimator.ekf.problem import Problem
from baryscope.estimator.ekf.start import Start, start_of, starts
from baryscope.estimator.findings import Finding, FreeAttitudes, UnknownPush, WrongOrbit
from baryscope.estimator.ml.search import likeliest_tumble
from baryscope.estimator.options import PathOptions, torques_of
from baryscope.estimator.orbits.error import inexact_parts
from baryscope.estimator.orbits.estimated import estimated_orbit_in
from baryscope.estimator.orbits.oblateness import perhaps_oblate_in
from baryscope.estimator.orbits.push import unknown_push_in
from baryscope.estimator.pivot.answer import estimate_of
from baryscope.estimator.pivot.method import PivotProblem, solve_pivot
from baryscope.estimator.pivot.orbits.accuracy import untold_accuracy
from baryscope.estimator.pivot.orbits.corrected import orbit_error_in
from baryscope.estimator.pivot.orbits.oblateness import untold_oblateness
from baryscope.estimator.pivot.orbits.pushed import push_in
from baryscope.estimator.pivot.pivot_solution import SIGNIFICANT, PivotSolution
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

MAX_FEATURES = 200  # all are among the unknowns
MAX_MEMORY = 8e9  # bytes


def estimate_by_filter(
    tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, progress: Progress = silent
) -> Estimate:
    """The centre of mass by an iterated extended Kalman filter, smoothed.

    The covariance is the smoother's, with the uncertainty of the process noise; `FilterDetails` has the filter's at the
    last frame, the mean normalised innovation squared (1 is expected), and the process noise. Where the filter leads
    nowhere, it is the estimate of `pivot`, and says so.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the tracks do not determine the unknowns, or there are too many.
    """
    begin = clock.perf_counter()
    _refuse_forces(options)
    found: Passes | None = None

    @cache
    def whole() -> PivotProblem:
        return PivotProblem.of(tracks, orbit, options)

    try:
        found = _filtered(tracks, orbit, options, whole, progress)
        if found.converged:
            answer = answer_of(found, begin)
            return replace(answer, findings=answer.findings + _findings_on_orbit(found.problem.path, orbit, whole))
        failure = ComputationError("the passes of the filter do not come to rest", Reason.DIVERGED)
    except ComputationError as error:
        failure = error
    free = None if failure.reason is Reason.TOO_LARGE else _with_free_attitudes(tracks, options, whole, begin)
    if free is not None and (found is None or free.converged):
        return replace(free, method="ekf", findings=(*free.findings, FreeAttitudes(str(failure))))
    if found is None:
        raise failure
    return answer_of(found, begin)


def _with_free_attitudes(
    tracks: FeatureTracks, options: PathOptions, whole: Callable[[], PivotProblem], begin: float
) -> Estimate | None:
    """The estimate of `pivot`; None if there is none."""
    try:
        return estimate_of(whole().solved, tracks, options, begin)
    except ComputationError:
        return None


def _filtered(
    tracks: FeatureTracks,
    orbit: Orbit | None,
    options: PathOptions,
    whole: Callable[[], PivotProblem],
    progress: Progress,
) -> Passes:
    """The passes from the first start from which they come to rest, else from the first that leads anywhere.

    whole: the problem of `pivot`, with all options, solved where it is needed.

    Raises:
        ComputationError: none does, or the tracks do not determine the unknowns, or there are too many.
    """
    trajectory, span = trajectory_of(options.trajectory, orbit), (float(tracks.time[0]), float(tracks.time[-1]))
    path, on_orbit = trajectory.path(orbit, *span, options.acceleration), trajectory.kind == "relative-orbit"
    measured, rounds, torques = observations_of(tracks, tracks.seen), Rounds(progress), torques_of(orbit, options)
    solved = whole().solved if path.prior.hyperparameters else _for_attitudes(tracks, orbit, options)
    if solved is not None:
        trajectory, told = replace(trajectory, highest=highest_degree(solved.path)), estimated_orbit_in(solved.path)
        path = _with_burns_of(solved, told or trajectory.path(orbit, *span, options.acceleration))
        if told is not None:
            on_orbit, torques = True, torques_of(told.orbit, options)
    theta = np.array([_found(solved, one.name) for one in path.prior.hyperparameters])

    def followed(start: Start, tracks: FeatureTracks = tracks, measured: Observations = measured) -> Passes:
        _refuse_effort(len(start.nodes.frames), len(start.nodes.time), tracks.seen.shape[1])
        rounds.did(0.5)
        return passes(
            Problem(
                tracks=tracks,
                options=options,
                measured=measured,
                start=start,
                path=path,
                on_orbit=on_orbit,
                theta=theta,
                rounds=rounds,
            )
        )

    def better() -> Passes | None:
        """From the tumble that `ml` finds: its steps are damped, and arrive from where passes do not."""
        try:
            points, _, best = likeliest_tumble(tracks, whole().solved, torques, options, rounds)
            found = followed(start_of(points, best), points, observations_of(points, points.seen))
        except ComputationError:
            return None
        return found if found.converged else None

    try:
        found = _first_of(starts(tracks, measured, solved, torques), followed)
    except ComputationError as error:
        if error.reason is Reason.TOO_LARGE or (other := better()) is None:
            raise
        found = other
    if not found.converged:
        found = better() or found
    return _with_untold_forces(found, orbit, trajectory, whole) if on_orbit else found


def _with_untold_forces(
    found: Passes, orbit: Orbit | None, trajectory: Trajectory, whole: Callable[[], PivotProblem]
) -> Passes:
    """The passes with J2, a push and errors of the orbit if `pivot` finds them, or does not tell them from none, and
    where the path has process noise with the burns that it finds, or that the attitudes show; whole: its problem, with
    all options.
    """
    problem = found.problem
    options, noise, time = problem.options, process_noise_of(found), problem.tracks.time
    noisy = (noise.significance or 0.0) >= SIGNIFICANT
    if not noisy and (orbit is None or (orbit.with_earths_j2() is None and orbit.accuracy == 0)):
        return found
    try:
        of_pivot, path = whole(), problem.path
        burned = _by_attitudes(of_pivot, found) if noisy else None
        solved = (burned or of_pivot).solved
        if untold_oblateness(orbit, solved.path):
            oblate = trajectory.path(orbit_in(solved.path), float(time[0]), float(time[-1]), options.acceleration)
            path = perhaps_oblate_in(solved.path) or oblate
        path = push_in(solved, path) or path
        for part in reversed(inexact_parts(solved.path)):
            path = replace(part, base=path)
        path = orbit_error_in(solved, path) or path
        if noisy:
            path = _with_burns_of(solved, path)
        return found if path is problem.path else passes(replace(problem, path=path))
    except ComputationError:
        return found


def _by_attitudes(problem: PivotProblem, found: Passes) -> PivotProblem | None:
    """The problem of `pivot` solved with the burns that the attitudes of passes show; None without any."""
    if found.problem.tracks.labels != problem.tracks.labels:  # labels that tracks have used twice
        return None
    at, frames, last = found.reference, found.problem.start.nodes.frames, found.last
    points = [at.points[body.features] for body in problem.solved.bodies]
    return problem.with_burns_of(points, at.attitude[frames], at.origin[frames], last.weight, last.residual_variance)


def _findings_on_orbit(path: Path, orbit: Orbit | None, whole: Callable[[], PivotProblem]) -> tuple[Finding, ...]:
    """What `pivot` has found of the orbit, as far as the path has it."""
    corrected = _of_pivot(whole, WrongOrbit) if inexact_parts(path) else ()
    pushed = _of_pivot(whole, UnknownPush) if unknown_push_in(path) is not None else ()
    return pushed + untold_oblateness(orbit, path) + untold_accuracy(path) + corrected


def _of_pivot(whole: Callable[[], PivotProblem], kind: type[Finding]) -> tuple[Finding, ...]:
    """Its findings of a kind."""
    return tuple(one for one in whole().solved.findings if isinstance(one, kind))


def _with_burns_of(solved: PivotSolution, path: Path) -> Path:
    """The path with the burns of a solution of `pivot`, if it has any."""
    burned = burned_in(solved.path)
    if burned is None:
        return path
    about = burned.about
    if about is not None:  # of which the first are those of motion and push, as the path's
        about = np.pad(about, (0, max(path.size - len(about), 0)))[: path.size]
    return replace(burned, base=path, about=about)


def _for_attitudes(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> PivotSolution | None:
    """The solution of `pivot`, for attitudes of weighted observations; None if there are none, or no solution.

    A registration weighs all points alike, so that its attitudes are noisier than the observations' covariances tell.
    """
    if tracks.covariance is None:
        return None
    try:
        return solve_pivot(tracks, orbit, replace(options, process_noise="none", sigma=None))
    except ComputationError:
        return None


def _found(solved: PivotSolution | None, name: str) -> float:
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
