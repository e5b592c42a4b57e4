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
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.ekf.answer import answer_of
from baryscope.estimator.ekf.densities import significance_of
from baryscope.estimator.ekf.passes import Passes, passes
from baryscope.estimator.ekf.prediction import PredictedTumble
from baryscope.estimator.ekf.problem import Problem
from baryscope.estimator.ekf.rival import LikelyPasses, likely_passes
from baryscope.estimator.ekf.start import Start, start_of, starts
from baryscope.estimator.findings import DisagreeingClusters, Finding, FreeAttitudes, UnknownPush, WrongOrbit
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.ml.search import likeliest_tumble
from baryscope.estimator.ml.two_models import Odds, PredictedMixture, with_other
from baryscope.estimator.options import PathOptions, torques_of
from baryscope.estimator.orbits.error import inexact_parts
from baryscope.estimator.orbits.estimated import estimated_orbit_in
from baryscope.estimator.orbits.oblateness import perhaps_oblate_in
from baryscope.estimator.orbits.push import unknown_push_in
from baryscope.estimator.paths.burns import burned_in
from baryscope.estimator.paths.doubtful_path import doubtful_parts
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.relative_motion import orbit_in
from baryscope.estimator.paths.seen_path import SeenPath
from baryscope.estimator.paths.trajectory import Trajectory, highest_degree, trajectory_of
from baryscope.estimator.pivot.answer import estimate_of
from baryscope.estimator.pivot.disagreement import disagreeing_by_tumble
from baryscope.estimator.pivot.method import PivotProblem, solve_pivot
from baryscope.estimator.pivot.orbits.accuracy import untold_accuracy
from baryscope.estimator.pivot.orbits.corrected import orbit_error_in
from baryscope.estimator.pivot.orbits.oblateness import untold_oblateness
from baryscope.estimator.pivot.orbits.pushed import push_in
from baryscope.estimator.pivot.pivot_solution import SIGNIFICANT, PivotSolution
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks, errors_of
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

MAX_FEATURES = 200  # all are among the unknowns
MAX_MEMORY = 8e9  # bytes
ALWAYS = 0.9  # share of the frames
SAME_NOISE = 9.0  # most that the variance of residuals may be of that with free attitudes


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
    task = _Task(tracks, orbit, options, Rounds(progress))
    found: Passes | None = None
    try:
        found, solved = _filtered(task)
        if found.converged:
            likely = likely_passes(found)
            found, answer = likely.best, _answer_of(likely, begin)
            on_orbit = _findings_on_orbit(task, found.problem.path)
            return replace(answer, findings=answer.findings + on_orbit + _disagreeing(task, solved, answer))
        failure = ComputationError("the passes of the filter do not come to rest", Reason.DIVERGED)
    except ComputationError as error:
        failure = error
    free = None if failure.reason is Reason.TOO_LARGE else _with_free_attitudes(task, begin)
    if free is not None and (found is None or free.converged):
        return replace(free, method="ekf", findings=(*free.findings, FreeAttitudes(str(failure))))
    if found is None:
        raise failure
    return answer_of(found, begin)


def _answer_of(likely: LikelyPasses, begin: float) -> Estimate:
    """The answer of the likelier model, with what the other one tells of the same features."""
    answer = answer_of(likely.best, begin)
    if likely.other is None:
        return answer
    if likely.alike:
        own = answer.predictor
        assert isinstance(own, PredictedTumble)  # noqa: S101  as an answer of passes has
        both = PredictedMixture(own, replace(own, found=likely.other), Odds(likely.probability))
        return replace(answer, predictor=both)
    other = answer_of(likely.other, begin)
    same = [one.labels for one in answer.clusters] == [one.labels for one in other.clusters]
    return with_other(answer, other, likely.probability) if same else answer


@dataclass(frozen=True, eq=False)
class _Task:
    """What the filter is asked for; rounds: told of each pass."""

    tracks: FeatureTracks
    orbit: Orbit | None
    options: PathOptions
    rounds: Rounds

    @cached_property
    def pivot(self) -> PivotProblem:
        """The problem of `pivot`, with all options, which is solved where it is needed first.

        Raises:
            ComputationError: the tracks do not determine the unknowns.
        """
        return PivotProblem.of(self.tracks, self.orbit, self.options)

    def path(self, trajectory: Trajectory, orbit: Orbit | None) -> Path:
        """The path of a trajectory on an orbit, over the tracks, with the known acceleration, as the camera sees it."""
        time = self.tracks.time
        return self.seen(trajectory.path(orbit, float(time[0]), float(time[-1]), self.options.acceleration))

    def seen(self, path: Path) -> Path:
        """A path with the camera's constant errors among its unknowns."""
        errors = errors_of(self.tracks)
        return path if errors is None or not len(errors.deviations) else SeenPath(path, errors)


def _with_free_attitudes(task: _Task, begin: float) -> Estimate | None:
    """The estimate of `pivot`; None if there is none."""
    try:
        return estimate_of(task.pivot.solved, task.tracks, task.options, begin)
    except ComputationError:
        return None


def _filtered(task: _Task) -> tuple[Passes, PivotSolution | None]:
    """The passes from the first start from which they come to rest, else from the first that leads anywhere; and the
    solution of `pivot` whose attitudes they start from, if there is one.

    Raises:
        ComputationError: none does, or the tracks do not determine the unknowns, or there are too many.
    """
    frames, features = task.tracks.seen.shape
    _refuse_effort(frames, frames, features)  # before `pivot` is solved, which may take a minute
    model = _Model.of(task)
    try:
        found = _first_of(model.starts(), model.passes)
    except ComputationError as error:
        if error.reason is Reason.TOO_LARGE or (other := model.passes_from_likeliest_tumble()) is None:
            raise
        found = other
    if not found.converged:
        found = model.passes_from_likeliest_tumble() or found
    return _with_untold_forces(task, found, model.trajectory) if model.on_orbit else found, model.solved


@dataclass(frozen=True, eq=False)
class _Model:
    """What the first passes assume.

    solved: the solution of `pivot` whose attitudes they start from, None if there is none; path without noise, and of
    which trajectory; on_orbit: whether it is a motion there; torques: the gravity gradients that may act.
    """

    task: _Task
    measured: Observations
    solved: PivotSolution | None
    trajectory: Trajectory
    path: Path
    on_orbit: bool
    torques: tuple[Orbit | None, ...]

    @classmethod
    def of(cls, task: _Task) -> "_Model":
        """The model for tracks: a path with hyperparameters is that of `pivot`, as far as it has solved the problem.

        Raises:
            ComputationError: it has to, but the tracks do not determine the unknowns.
        """
        tracks, orbit, options = task.tracks, task.orbit, task.options
        trajectory = trajectory_of(options.trajectory, orbit)
        path, on_orbit = task.path(trajectory, orbit), trajectory.kind == "relative-orbit"
        measured, torques = observations_of(tracks, tracks.seen), torques_of(orbit, options)
        solved = task.pivot.solved if path.prior.hyperparameters else _for_attitudes(tracks, orbit, options)
        if solved is not None:
            trajectory = replace(trajectory, highest=highest_degree(solved.path))
            estimated = estimated_orbit_in(solved.path)
            path = task.path(trajectory, orbit) if estimated is None else task.seen(estimated)
            path = _with_burns_of(solved, path)
            if estimated is not None:
                on_orbit, torques = True, torques_of(estimated.orbit, options)
        return cls(task, measured, solved, trajectory, path, on_orbit, torques)

    def starts(self) -> Iterator[Start]:
        """See `starts`."""
        return starts(self.task.tracks, self.measured, self.solved, self.torques)

    def passes(self, start: Start) -> Passes:
        """The passes from a start.

        Raises:
            ComputationError: they lead nowhere, or there are too many unknowns.
        """
        return self._passes(start, self.task.tracks, self.measured)

    def passes_from_likeliest_tumble(self) -> Passes | None:
        """The passes from the tumble that `ml` finds, whose steps are damped, and arrive from where passes do not; None
        where these do not come to rest, or do so at another tumble, which is far from the points.
        """
        task = self.task
        try:
            free = task.pivot.solved
            tracks, _, best = likeliest_tumble(task.tracks, free, self.torques, task.options, task.rounds)
            found = self._passes(start_of(tracks, best), tracks, observations_of(tracks, tracks.seen))
        except ComputationError:
            return None
        fits = found.last.residual_variance <= SAME_NOISE * free.residual_variance
        return found if found.converged and fits else None

    def _passes(self, start: Start, tracks: FeatureTracks, measured: Observations) -> Passes:
        """The passes over the tracks, or over those with new labels where some were used twice."""
        _refuse_effort(len(start.nodes.frames), len(start.nodes.time), tracks.seen.shape[1])
        self.task.rounds.did(0.5)
        return passes(
            Problem(
                tracks=tracks,
                options=self.task.options,
                measured=measured,
                start=start,
                path=self.path,
                on_orbit=self.on_orbit,
                theta=np.array([_found(self.solved, one.name) for one in self.path.prior.hyperparameters]),
                rounds=self.task.rounds,
            )
        )


def _with_untold_forces(task: _Task, found: Passes, trajectory: Trajectory) -> Passes:
    """The passes with J2, a push and errors of the orbit if `pivot` finds them, or does not tell them from none, and
    where the path has process noise with the burns that it finds, or that the attitudes show. What `pivot` leaves to
    the time before and after the tracks is left to it here.
    """
    problem, orbit = found.problem, task.orbit
    noisy = (significance_of(found) or 0.0) >= SIGNIFICANT
    exact = orbit is not None and orbit.with_earths_j2() is None and orbit.accuracy == 0
    if not noisy and (exact or (orbit is None and estimated_orbit_in(problem.path) is None)):
        return found
    try:
        path = problem.path
        burned = _by_attitudes(task.pivot, found) if noisy else None
        solved = (burned or task.pivot).solved
        if orbit is not None and untold_oblateness(orbit, solved.path):
            oblate = perhaps_oblate_in(solved.path)
            path = task.path(trajectory, orbit_in(solved.path)) if oblate is None else task.seen(oblate)
        path = push_in(solved, path) or path
        for part in reversed(inexact_parts(solved.path)):
            path = part.acting(path)
        path = orbit_error_in(solved, path) or path
        if noisy:
            path = _with_burns_of(solved, path)
        found = found if path is problem.path else passes(replace(problem, path=path))
        path = found.problem.path
        for left_out in reversed(doubtful_parts(solved.path)):
            path = replace(left_out, base=path)
        return replace(found, problem=replace(found.problem, path=path))
    except ComputationError:
        return found


def _by_attitudes(problem: PivotProblem, found: Passes) -> PivotProblem | None:
    """The problem of `pivot` solved with the burns that the attitudes of passes show; None without any."""
    if found.problem.tracks.labels != problem.tracks.labels:  # labels that tracks have used twice
        return None
    (attitude, origin, seen), last = found.reference.as_seen(found.problem.start.nodes), found.last
    points = [seen[body.features] for body in problem.solved.bodies]
    return problem.with_burns_of(points, attitude, origin, last.weight, last.residual_variance)


def _disagreeing(task: _Task, solved: PivotSolution | None, answer: Estimate) -> tuple[DisagreeingClusters, ...]:
    """What a solution of `pivot` finds of clusters that disagree, if the answer's attitudes do not settle it.

    Without a solution, `pivot` is solved for it, unless three features are seen nearly always: these are one cluster.
    """
    if solved is None and np.sum(task.tracks.seen.mean(axis=0) > ALWAYS) < FEWEST_POINTS:
        try:
            solved = task.pivot.solved
        except ComputationError:
            return ()
    return () if solved is None else disagreeing_by_tumble(solved, answer, task.tracks)


def _findings_on_orbit(task: _Task, path: Path) -> tuple[Finding, ...]:
    """What `pivot` has found of the orbit, as far as the path has it."""
    corrected = _of_pivot(task, WrongOrbit) if inexact_parts(path) else ()
    pushed = _of_pivot(task, UnknownPush) if unknown_push_in(path) is not None else ()
    return pushed + untold_oblateness(task.orbit, path) + untold_accuracy(path) + corrected


def _of_pivot(task: _Task, kind: type[Finding]) -> tuple[Finding, ...]:
    """The findings of `pivot` of a kind."""
    return tuple(one for one in task.pivot.solved.findings if isinstance(one, kind))


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
