"""pivot: the drifting pivot. Bodies from the tracks, one linear least squares, and its refinement with free attitudes.

The attitude is free in every frame, so no model of the rotation is needed; the model of the path of the centre of mass
connects the frames.
"""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.degrees_of_freedom import least_variance
from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import NEGLIGIBLE
from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, Subsample, subsampled
from baryscope.estimator.adjustment.weighted_registration import with_covariances
from baryscope.estimator.options import PathOptions
from baryscope.estimator.orbits.estimated import estimated_orbit
from baryscope.estimator.orbits.push import unknown_push
from baryscope.estimator.paths.interpolated_path import interpolated
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.process_noise import DENSITY, told_slip
from baryscope.estimator.paths.trajectory import SMOOTH_DEGREES, Trajectory, chosen_path, smooth_in, trajectory_of
from baryscope.estimator.pivot.answer import estimate_of
from baryscope.estimator.pivot.burns.poses import KnownPoses
from baryscope.estimator.pivot.burns.solution import (
    may_have_burns,
    unknown_burns,
    with_burns_by,
    with_unknown_burns,
)
from baryscope.estimator.pivot.collinear import attitudes_about, refuse_untold
from baryscope.estimator.pivot.initial_solution import InitialSolution
from baryscope.estimator.pivot.joint_covariance import is_at_rest
from baryscope.estimator.pivot.lack_of_fit import misfits, slips_excessively
from baryscope.estimator.pivot.orbits.accuracy import untold_accuracy, with_errors_of_orbit
from baryscope.estimator.pivot.orbits.corrected import corrected_for_orbit, wrong_orbit
from baryscope.estimator.pivot.orbits.estimated import with_estimated_orbit
from baryscope.estimator.pivot.orbits.oblateness import untold_oblateness
from baryscope.estimator.pivot.orbits.pushed import with_push
from baryscope.estimator.pivot.orbits.smooth_forces import with_smooth_forces
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.refinement import ROUNDING, refined
from baryscope.estimator.pivot.start import LinearStart, linear_start
from baryscope.estimator.pivot.strays import without_strays
from baryscope.estimator.pivot.unexplained import gain_over, is_better, with_needed_noise
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered, find_bodies
from baryscope.estimator.registration.collinear import find_collinear
from baryscope.estimator.registration.screening import screen
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks, errors_of
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAX_BODY_FEATURES = 1000  # of a cluster: with as many, an adjustment takes minutes and a gigabyte
MOST_LASTING = 10.0  # frames with the same errors, at first: labels that are exchanged seem to be errors of a hundred
SEEN = 0.1  # variance of degrees left out times information on a coefficient, from which the tracks see them


def estimate_by_pivot(tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions) -> Estimate:
    """The centre of mass by the drifting pivot.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the tracks do not determine the unknowns.
    """
    begin = clock.perf_counter()
    return estimate_of(solve_pivot(tracks, orbit, options), tracks, options, begin)


def solve_pivot(tracks: FeatureTracks, told: Orbit | None, options: PathOptions) -> PivotSolution:
    """The least-squares solution for bodies and path, with its findings; see `PivotProblem`."""
    return PivotProblem.of(tracks, told, options).solved


@dataclass(frozen=True, eq=False)
class PivotProblem:
    """The problem of `pivot` with its solution, and what it goes on from when burns are looked for once more.

    told: the orbit as given, and orbit: with the Earth's J2 if that acts. In the order in which they are reached:

    - start: before any step, with all frames; a solution from there that has no need of a push is unpushed, else None.
    - plain: the solution without burns that nothing told, and without frames whose attitudes stray, and plain_start,
      which leaves these out, too.
    - burned: with such burns; `plain` where there are none.
    - solved: with a push and an error of the orbit where they are shown, and with findings.
    """

    tracks: FeatureTracks
    told: Orbit | None
    orbit: Orbit | None
    options: PathOptions
    registered: Registered
    start: InitialSolution
    unpushed: PivotSolution | None
    plain: PivotSolution
    plain_start: InitialSolution
    burned: PivotSolution
    solved: PivotSolution

    @classmethod
    def of(cls, tracks: FeatureTracks, told: Orbit | None, options: PathOptions) -> "PivotProblem":
        """The problem of tracks, solved.

        Raises:
            InputError: an invalid combination of options, or a singular covariance.
            ComputationError: the tracks do not determine the unknowns.
        """
        trajectory = trajectory_of(options.trajectory, told)
        data = _ProblemData.of(tracks, trajectory.path(told, float(tracks.time[0]), float(tracks.time[-1])))
        found, start = _of_chosen_degree(data, trajectory, told, options)
        found, start = with_estimated_orbit(found, start, options)
        forced = with_smooth_forces(found, start, told, options)
        plain, plain_start = without_strays(forced.found, forced.start, options)
        problem = cls(
            tracks=tracks,
            told=told,
            orbit=forced.orbit,
            options=options,
            registered=data.registered,
            start=forced.start,
            unpushed=forced.unpushed,
            plain=plain,
            plain_start=plain_start,
            burned=plain,
            solved=plain,
        )
        if data.registered.in_line:
            return problem._finished(plain, plain_start)
        # Where burns are left to noise, attitudes stray by it: all are looked at once more.
        return problem._with_burns(*with_unknown_burns(plain, data.registered, forced.orbit, forced.start, options))

    def with_burns_of(
        self,
        points: Sequence[FloatArray],
        attitude: FloatArray,
        origin: FloatArray,
        weight: FloatArray,
        variance: float,
    ) -> "PivotProblem | None":
        """The problem solved with the burns that a known motion shows; None without any, or if it is no likelier.

        Only on an orbit, where the solution leaves something to process noise: a smooth path follows burns by itself,
        and to look for them takes many times as long as all else. points (m, 3) of each of its bodies from the centre
        of mass, in axes that all have in common, m; attitude (n, 3, 3) of these in C, as it is seen, origin (n, 3) in
        C, m; weight (n, m): robust, of the observations; variance of one of weight 1.
        """
        path = self.start.path
        if path.name != "relative-orbit" or not (may_have_burns(path, self.options) and self.solved.has(DENSITY)):
            return None
        pairs = zip(self.solved.bodies, points, strict=True)
        bodies = tuple(replace(body, points=own, attitude=attitude[body.frames]) for body, own in pairs)
        posed = KnownPoses.of(bodies, self.start.measured.weighted(weight), origin, variance)
        found = with_burns_by(posed, self.plain, self.orbit, self.start.near(self.plain), self.options)
        if found is None or gain_over(self.burned, found[0], self.start) <= 0:
            return None
        return self._with_burns(*found)

    def _with_burns(self, burned: PivotSolution, start: InitialSolution) -> "PivotProblem":
        if burned is self.plain:
            return self._finished(burned, self.plain_start)
        burned, start = without_strays(burned, start, self.options)
        return replace(self, burned=burned)._finished(burned, start)

    def _finished(self, found: PivotSolution, start: InitialSolution) -> "PivotProblem":
        """The problem with a solution for a push and an error of the orbit, and with findings."""
        orbit, options = self.orbit, self.options
        if found is not self.unpushed:
            found, start = with_push(found, start, orbit, options)
        found = corrected_for_orbit(found, orbit, start, options) or found
        found = with_errors_of_orbit(found, orbit, start, options)
        refuse_untold(found, self.registered)
        findings = misfits(found, self.registered, self.tracks) + wrong_orbit(found, orbit)
        of_x = found.variance * found.solution.covariance
        findings += estimated_orbit(found.path, found.solution.x, of_x)
        findings += unknown_burns(found.path, found.solution.x, of_x) + unknown_push(found.path, found.solution.x, of_x)
        findings += untold_oblateness(self.told, found.path) + untold_accuracy(found.path)
        found = replace(found, converged=found.converged or is_at_rest(found), findings=findings)
        return replace(self, solved=found.at_mean(errors_of(self.tracks)))


def _of_chosen_degree(
    data: "_ProblemData", trajectory: Trajectory, orbit: Orbit | None, options: PathOptions
) -> tuple[PivotSolution, InitialSolution]:
    """The solution on a path of enough degrees, and its start.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    time, errors = data.tracks.time, errors_of(data.tracks)
    # On an orbit no pivot slips, but a camera shakes: unless it is told by how much.
    told = trajectory.kind == "relative-orbit" and errors is not None and errors.noisy
    slips = options.process_noise == "auto" and not told
    best: tuple[PivotSolution, InitialSolution] | None = None
    for highest in SMOOTH_DEGREES:
        path = chosen_path(options, orbit, float(time[0]), float(time[-1]), errors, highest)
        try:
            start = replace(data.start(path), slips=slips, slip=told_slip(path, options.process_noise))
            found = _refined(start, options)
        except ComputationError:
            if best is None:
                raise
            break
        if best is not None and not is_better(found, *best):
            break
        best = found, start
        cut_short = _is_cut_short(found)
        if not (cut_short or _may_lack_degrees(found)):
            break
        # Of a path with more degrees they tell less; one that is cut short is no answer, however likely.
        refuse_untold(found, data.registered)
        best = None if cut_short else best
    return best or (found, start)


@dataclass(frozen=True, eq=False)
class _ProblemData:
    """What is there before a path is chosen.

    The tracks, and inliers (n, m) among them; all observations, measured, and those of the registered bodies in their
    frames; few of them, from which solutions start; lasting: how many frames have the same errors of the features.
    """

    tracks: FeatureTracks
    inliers: BoolArray
    registered: Registered
    measured: Observations
    observations: Observations
    few: Subsample
    lasting: float

    @classmethod
    def of(cls, tracks: FeatureTracks, path: Path) -> "_ProblemData":
        """The data of tracks, whose frames have to be enough for a path.

        Raises:
            InputError: a singular covariance.
            ComputationError: there are no bodies, or too large ones, or in too few frames.
        """
        measured = observations_of(tracks, tracks.seen)
        inliers = screen(tracks.position, tracks.seen, tracks.covariance)
        registered = _registered(tracks, inliers, path)
        most = max(len(body.features) for body in registered.bodies)
        if most > MAX_BODY_FEATURES:
            raise ComputationError(
                f"{most} features in a cluster, for which the adjustment would take hours: "
                f"use at most {MAX_BODY_FEATURES} of them at a time, or the method score",
                Reason.TOO_LARGE,
            )
        right = measured.weighted(np.where(inliers, 1.0, 0.0))
        if not registered.in_line:
            registered, right = with_covariances(registered, right)
        observations = _restricted(measured, right, registered.bodies)
        few = subsampled(registered.bodies, observations, SUBSAMPLE_FRAMES)
        return cls(tracks, inliers, registered, measured, observations, few, _lasting(registered, observations))

    def start(self, path: Path) -> InitialSolution:
        """The initial solution for a path."""
        time, registered, given = self.tracks.time, self.registered, self.measured.precision is not None
        sampled = interpolated(path.at, path.frequency, time[self.few.rows])
        least = least_variance(self.measured, ROUNDING)
        initial = linear_start(registered, self.few, sampled, path.prior, least, self.lasting)
        everywhere = interpolated(path.at, path.frequency, time)
        bodies = initial.bodies
        if registered.in_line:
            bodies = attitudes_about(bodies, self.observations, everywhere.position(initial.x))
        return InitialSolution(
            path=path,
            sampled=everywhere,
            time=time,
            registered=registered.bodies,
            bodies=bodies,
            x=initial.x,
            measured=self.measured,
            observations=self.observations,
            inliers=self.inliers,
            weight=self._weight(initial) if given else None,
            lasting=self.lasting,
            variance=1.0 if given else registered.noise**2,
            errors=errors_of(self.tracks),
            first_prior=initial.first_prior,
        )

    def _weight(self, initial: LinearStart) -> FloatArray:
        """The weights (n, m) of the observations, those of the initial solution where it has looked at them."""
        found = self.observations.weight.copy()
        pairs = zip(self.registered.bodies, self.few.bodies, self.few.steps, strict=True)
        for body, few, step in pairs:
            found[np.ix_(body.frames[::step], body.features)] = initial.weight[few.block]
        return found


def _registered(tracks: FeatureTracks, inliers: BoolArray, path: Path) -> Registered:
    """The bodies of features that give attitudes; those in a line where these are none, or too few for a path.

    Raises:
        ComputationError: there are neither, or in too few frames.
    """
    try:
        bodies = find_bodies(tracks.position, inliers, tracks.time)
        _refuse_few_frames(bodies.bodies, path)
        return bodies
    except ComputationError as error:
        if error.reason not in (Reason.TOO_FEW_FEATURES, Reason.COLLINEAR_FEATURES, Reason.TOO_FEW_FRAMES):
            raise
        in_line = find_collinear(tracks.position, inliers, tracks.time)
        if in_line is None:
            raise
        _refuse_few_frames(in_line.bodies, path)
        return in_line


def _lasting(registered: Registered, observations: Observations) -> float:
    """How many frames have the same errors of the features, before there is a path."""
    origin = np.zeros((len(observations.position), 3))
    for body, own in zip(registered.bodies, registered.origins, strict=True):
        origin[body.frames] = own
    return min(frames_per_error(registered.bodies, observations, origin), MOST_LASTING)


def _refined(start: InitialSolution, options: PathOptions) -> PivotSolution:
    """The refined solution, with covariances at once with the path's own prior; with the noise that it needs.

    They make the start so good that to begin anew from a simple path would spoil it, unless it leads nowhere.
    """
    at_once = start.measured.precision is not None and start.first_prior is not None
    found = refined(replace(start, first_prior=None) if at_once else start, options)
    if at_once and not found.converged:
        found = refined(start, options)
    return with_needed_noise(found, start, options)


def _is_cut_short(found: PivotSolution) -> bool:
    """Whether a smooth path has degrees beyond its highest that the tracks see, where they tell it best."""
    smooth = smooth_in(found.path)
    if smooth is None:
        return False
    own = found.posterior.theta[: len(smooth.prior.hyperparameters)]
    information = found.posterior.information[smooth.size - 3 : smooth.size].max()
    return smooth.omitted_variance(own) * float(information) > SEEN


def _may_lack_degrees(found: PivotSolution) -> bool:
    """Whether more degrees of a smooth path may be what it lacks: it leads to no solution, or all to noise."""
    return smooth_in(found.path) is not None and (not found.converged or slips_excessively(found))


def _refuse_few_frames(bodies: tuple[Body, ...], path: Path) -> None:
    """Check that bodies have attitudes in enough frames for the unknowns of a path and of their offsets.

    Raises:
        ComputationError: they have not.
    """
    frames, count = sum(len(body.frames) for body in bodies), len(bodies)
    free = int(path.prior.free.sum())
    if 3 * frames <= free + 3 * count:
        raise ComputationError(
            f"{counted(frames, 'frame shows', 'frames show')} an attitude, too few for {path.name}: "
            f"more than {free // 3 + count} needed",
            Reason.TOO_FEW_FRAMES,
        )


def _restricted(measured: Observations, right: Observations, bodies: tuple[Body, ...]) -> Observations:
    """The observations of the bodies in their frames, with the weights of those that are right; outliers keep a
    negligible weight, for their residuals.
    """
    weight = np.zeros_like(measured.weight)
    for body in bodies:
        block = body.block
        weight[block] = measured.weight[block] * np.maximum(right.weight[block], NEGLIGIBLE)
    return measured.weighted(weight)
