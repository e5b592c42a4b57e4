"""ml: maximum a posteriori estimate of rate, inertia up to scale, path and points of one tumbling body.

It is maximum likelihood with weak Gaussian priors on the inertia and on the path, see `priors`, and with those of the
noise of path and torque.

The iteration starts from `pivot` and the rotation fitted to its attitudes. The accuracy comes from the model: eight
numbers of rate and inertia determine the attitudes of all frames, and all features belong to one body.
"""

import time as clock
from dataclasses import replace

from baryscope.estimator.findings import FREE_TUMBLE, ExcessResiduals, FreeAttitudes
from baryscope.estimator.ml.answer import answer_of
from baryscope.estimator.ml.burns import with_burns_of_tumble
from baryscope.estimator.ml.iteration import STAGE
from baryscope.estimator.ml.search import LikelyTumbles, likely_tumbles
from baryscope.estimator.ml.two_models import with_other
from baryscope.estimator.options import PathOptions, torques_of
from baryscope.estimator.orbits.estimated import estimated_orbit_in
from baryscope.estimator.pivot.answer import estimate_of
from baryscope.estimator.pivot.method import PivotProblem
from baryscope.estimator.progress import Progress, Rounds, silent
from baryscope.estimator.prose import sentence
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import Orbit


def estimate_by_likelihood(
    tracks: FeatureTracks, orbit: Orbit | None, options: PathOptions, progress: Progress = silent
) -> Estimate:
    """The maximum a posteriori estimate of the centre of mass.

    Where the attitudes are of no tumble, or of one that is not found, it is the estimate of `pivot`, and says so.

    Raises:
        InputError: an invalid combination of options, or a singular covariance.
        ComputationError: the tracks do not determine the unknowns.
    """
    begin, done = clock.perf_counter(), Rounds(progress)
    torques = torques_of(orbit, options)
    problem = PivotProblem.of(tracks, orbit, options)
    if (part := estimated_orbit_in(problem.solved.path)) is not None:
        torques = torques_of(part.orbit, options)
    done.did(STAGE)
    try:
        found, problem = _tumbling(problem, torques, done)
        reason = _without_tumble(found, options)
    except ComputationError as error:
        reason = str(error)
    if reason is None:
        return replace(found, wall_time=clock.perf_counter() - begin)
    free = estimate_of(problem.solved, tracks, options, begin)
    return replace(free, method="ml", findings=(*free.findings, FreeAttitudes(reason)))


def _without_tumble(found: Estimate, options: PathOptions) -> str | None:
    """Why an estimate with a tumble is worse than one with free attitudes, if it is."""
    if not found.converged:
        return "the steps to a tumble do not converge"
    if options.torque_noise == "none":
        return None  # a tumble without noise is what is asked for, whether it fits or not
    misfits = [one for one in found.findings if isinstance(one, ExcessResiduals) and one.model == FREE_TUMBLE]
    return sentence(misfits[0]) if misfits else None


def _tumbling(problem: PivotProblem, torques: tuple[Orbit | None, ...], done: Rounds) -> tuple[Estimate, PivotProblem]:
    """The estimate with a tumble, without the time it took, and the problem of `pivot` from which it is reached: with
    burns that the tumble shows, if it does.

    Raises:
        ComputationError: no tumble is found.
    """
    options = problem.options
    found = likely_tumbles(problem.tracks, problem.solved, torques, options, done)
    burned = with_burns_of_tumble(problem, found.pivot, found.best)
    if burned is not None:
        again = _of_burned(burned, torques, done)
        if again is not None:
            problem, found = burned, again
    answer, other = answer_of(found.tracks, found.pivot, found.best, options), found.other
    if other is not None:
        second = answer_of(found.tracks, found.pivot, other.maximum, options)
        answer = with_other(answer, second, other.probability)
    return answer, problem


def _of_burned(problem: PivotProblem, torques: tuple[Orbit | None, ...], done: Rounds) -> LikelyTumbles | None:
    """The tumbles from a solution with burns; None if they do not converge."""
    try:
        found = likely_tumbles(problem.tracks, problem.solved, torques, problem.options, done)
    except ComputationError:
        return None
    return found if found.best.converged else None
