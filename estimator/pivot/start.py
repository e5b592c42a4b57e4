"""The initial solution: linear least squares under several priors of the path, of which the best is refined.

A flexible path can follow the body's rotation and so hide a wrong offset. There the linearised problem does not show
the better solution, as errors of the attitudes times a change of the offset are of second order. So a smooth path
starts from a straight line, from coefficients that decrease fast or slowly, and from a place at rest; any path starts
without process noise. One on an orbit also starts with it, unless without it hardly anything hides: the rotation tells
the offset, which is not that of noisy attitudes, and what is left is no more than the noise of the features' distances
from each other, which no path changes.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.degrees_of_freedom import values_for_path
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import Mixture, rejects_many, reweighted
from baryscope.estimator.adjustment.subsample import Subsample
from baryscope.estimator.hyperparameters.evidence import held, improved
from baryscope.estimator.paths.path import DECAY, FIRST, FREQUENCY, OVERTONES
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.process_noise import DENSITY
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.collinear import collinear_start
from baryscope.estimator.pivot.drift import Drift, DriftEquations, drift_equations, frame_roots
from baryscope.estimator.pivot.free_attitudes import MOST_HALVINGS, Solution, StepStart, linearised, squares_of_used
from baryscope.estimator.pivot.joint_covariance import SPURIOUS
from baryscope.estimator.pivot.offset_prior import a_priori_information
from baryscope.estimator.pivot.pivot_solution import spurious_of_known
from baryscope.estimator.pivot.reduced import bounded_cost, scaled, stepped
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered
from baryscope.models.errors import ComputationError

FloatArray = NDArray[np.float64]

FREQUENCIES = (0.01, 0.4, 2.0, 8.0)  # of a smooth path's coefficients, from which solutions start
NOTHING = -200.0  # logarithm of a density without effect
WAVES = tuple({DENSITY: NOTHING, OVERTONES: DECAY[1], FREQUENCY: float(np.log(frequency))} for frequency in FREQUENCIES)
SIMPLE_AND_SMOOTH = (*WAVES, WAVES[0] | {FIRST: NOTHING})  # the last at rest
STEPS = 5  # of Gauss and Newton under a prior that keeps the path simple
SOFT_ROUNDS = 10  # of linear least squares with weights by the residuals of frames with covariances
SETTLING = 12  # steps under the path's own prior, at most, before the solutions are compared
SETTLED = 0.1  # squared length of the last step, in units of the covariance of all unknowns
CHANCE = 2.0  # standard deviations of the ratio of two variances, by which they differ as by chance


@dataclass(frozen=True, eq=False)
class _Trial:
    """A solution for some frames: bodies, x (p,), and observations with robust weights.

    held: the hyperparameters, by their logarithms, that the prior from which it began holds; theta (h,): the others of
    that prior, or those of the path's own, from which steps go on; see `maximise`. last: the last step, and variance:
    of an observation of weight 1 there.
    """

    bodies: tuple[Body, ...]
    x: FloatArray
    observations: Observations
    held: dict[str, float]
    theta: FloatArray | None = None
    last: Solution | None = None
    variance: float = np.nan


@dataclass(frozen=True, eq=False)
class LinearStart:
    """Initial bodies and x (p,), and the weights (n, m) of the subsample's observations there.

    first_prior: to go on with until weights have settled: the simple one from which it began, for a place at rest the
    path's own as it is found there; None if it began from the path's own.
    """

    bodies: tuple[Body, ...]
    x: FloatArray
    weight: FloatArray
    first_prior: Prior | None = None


def linear_start(
    registered: Registered, few: Subsample, sampled: SampledPath, prior: Prior, least: float, lasting: float
) -> LinearStart:
    """The best of several solutions, of linear least squares and some steps.

    few: a subsample of the registered bodies, with the path sampled at its frames; least: lower bound of the variance
    of an observation of weight 1; lasting: how many frames have the same errors of the features.
    """
    own = _in_subsample(registered, few)
    smooth = prior.index(FREQUENCY) is not None
    simple = SIMPLE_AND_SMOOTH if smooth else ({DENSITY: NOTHING},)
    begins = (*simple, {}) if prior.hyperparameters else ({},)
    solution = _linear_solutions(own, few.observations, sampled)
    begun = (_Trial(*solution(prior.holding(held)), few.observations, held) for held in begins)
    if len(begins) > 1:
        variance = lasting * max(own.noise**2 if few.observations.precision is None else 1.0, least)
        offset_information = variance * a_priori_information(registered.bodies)[:, None, None] * np.eye(3)
        go_on = partial(_stepped, sampled=sampled, offset_information=offset_information, least=least, lasting=lasting)
        # A single simple prior, that of an orbit, has to hold against attitudes that outliers have spoilt.
        steps = STEPS if smooth or few.observations.precision is None else SETTLING
        enough = None if smooth else partial(_is_explained, registered, sampled, float(prior.free.sum()))
        trials = _settled(begun, go_on, prior, steps, enough)
        found = trials[_best(trials, sampled, prior, least, lasting) if len(trials) > 1 else 0]
    else:
        found = next(begun)
    pairs = zip(registered.bodies, found.bodies, strict=True)
    bodies = tuple(replace(body, points=refined.points) for body, refined in pairs)
    if few.observations.precision is not None:  # else registration has given them
        at_frames = zip(bodies, found.bodies, few.steps, strict=True)
        bodies = tuple(_with_attitudes(body, refined, step) for body, refined, step in at_frames)
    initial = LinearStart(bodies, found.x, found.observations.weight)
    if not found.held:
        return initial
    if FIRST not in found.held:
        return replace(initial, first_prior=prior.holding(found.held))
    assert found.theta is not None  # noqa: S101  it was stepped
    return replace(initial, first_prior=prior.at(found.theta))


def _hyperparameters(trial: _Trial, prior: Prior) -> FloatArray | None:
    """The hyperparameters (h,) of the path's own prior, near which a trial is after steps under its simple one; NaN
    for process noise.

    None where it was at rest, which tells nothing of how the path moves.
    """
    if FIRST in trial.held:
        return None
    assert trial.theta is not None  # noqa: S101  it was stepped
    simple = prior.holding(trial.held).hyperparameters
    values = trial.held | dict(zip((one.name for one in simple), trial.theta, strict=True))
    if DENSITY in trial.held:
        values[DENSITY] = np.nan
    return np.array([values[one.name] for one in prior.hyperparameters])


def _with_attitudes(body: Body, refined: Body, step: int) -> Body:
    """A body with the attitudes of a solution in each of so many frames."""
    attitude = body.attitude.copy()
    attitude[::step] = refined.attitude
    return replace(body, attitude=attitude)


def _settled(
    trials: Iterable[_Trial],
    stepped: Callable[..., _Trial],
    prior: Prior,
    steps: int,
    enough: Callable[[_Trial], bool] | None,
) -> list[_Trial]:
    """The trials after at most so many steps under the priors from which they began, then under the path's own.

    One that diverges, as may happen where its simple path is far from the true one, is left out. One that is enough
    under its simple prior is the only one.

    Raises:
        ComputationError: all diverge.
    """
    found, failure = [], None
    for trial in trials:
        try:
            own = stepped(trial, prior=prior.holding(trial.held), steps=steps)
            near = replace(own, theta=_hyperparameters(own, prior))
            settled = stepped(near, prior=prior, steps=SETTLING)
            if enough is not None and enough(own):
                return [replace(settled, held={})]  # no longer to be kept simple
            found.append(settled)
        except ComputationError as error:
            failure = error
    if not found and failure is not None:
        raise failure
    return found


def _is_explained(registered: Registered, sampled: SampledPath, path_size: float, trial: _Trial) -> bool:
    """Whether a trial leaves no more of observations without covariances than the noise that registration found, with
    offsets that the rotation tells, not the noise of the attitudes.

    Where many are outliers these may be part of that noise.
    """
    dof = values_for_path(trial.bodies, trial.observations) - path_size
    if (
        trial.observations.precision is not None
        or min(dof, registered.values) <= 0
        or rejects_many(trial.observations.weight)
    ):
        return False
    if trial.last is None or trial.last.offset_null_space.size:
        return False
    by_chance = 1 + CHANCE * float(np.sqrt(2 / dof + 2 / registered.values))
    if trial.last.squares.sum() > by_chance * dof * registered.noise**2:
        return False
    origin = sampled.position(trial.x)
    feigned = block_diag(*spurious_of_known(trial.bodies, trial.observations, origin, trial.variance, None))
    return float(np.linalg.eigvals(trial.last.offset_covariance @ feigned).real.max()) < SPURIOUS


def _stepped(
    trial: _Trial,
    prior: Prior,
    steps: int,
    *,
    sampled: SampledPath,
    offset_information: FloatArray,
    least: float,
    lasting: float,
) -> _Trial:
    """The trial after steps with robust weights, until they are small; offset_information (k, 3, 3): see `linearised`.

    Where registration has rejected many there are such weights before the first step: its own know nothing of the path.
    A line has no attitudes before it.
    """
    bodies, x, observations, theta = trial.bodies, trial.x, trial.observations, trial.theta
    dof = max(values_for_path(bodies, observations), 1.0)
    if theta is None and _has_many_outliers(observations) and not bodies[0].in_line:
        squares = linearised(bodies, observations, sampled, x, offset_information=offset_information).squares
        observations = observations.weighted(reweighted(squares, observations.weight, dof, least, many=True))
    here, halvings, solution, variance = None, 0, None, np.nan
    for _ in range(steps):
        problem = linearised(bodies, observations, sampled, x, offset_information=offset_information)
        if here is not None and halvings < MOST_HALVINGS and here.is_worse(problem, observations.weight):
            halvings, (bodies, x) = halvings + 1, here.halfway(bodies, x)
            continue
        halvings = 0
        variance = lasting * max(float(problem.squares.sum()) / dof, least)
        theta = improved(scaled(problem, variance), prior, theta)
        solution = stepped(problem, prior, theta, variance)
        if observations.precision is not None:
            precision = held(scaled(problem, variance), prior, theta)[0]
            here = StepStart(problem, observations.weight, variance / lasting, lasting, precision)
        if solution.decrease <= SETTLED * variance:
            break
        bodies, x = solution.bodies, solution.x
        observations = observations.weighted(reweighted(problem.squares, observations.weight, dof, least, many=True))
    return _Trial(bodies, x, observations, trial.held, theta, solution, variance)


def _best(trials: list[_Trial], sampled: SampledPath, prior: Prior, least: float, lasting: float) -> int:
    """The trial of the greatest marginal likelihood, with outliers of a bounded cost, for the least variance of any."""
    problems, mixtures = [], []
    for trial in trials:
        problem = linearised(trial.bodies, trial.observations, sampled, trial.x)
        weight = trial.observations.weight
        problems.append(problem)
        share = max(values_for_path(trial.bodies, trial.observations) / (3 * float(weight.sum())), 1e-3)
        mixtures.append(Mixture.of(squares_of_used(problem, weight), share, least))
    finest = min(mixtures, key=lambda one: one.variance)
    scores = [
        bounded_cost(problem, trial.observations.weight, lasting * finest.variance, prior, trial.theta, finest.gate)
        for trial, problem in zip(trials, problems, strict=True)
    ]
    return int(np.argmin(scores))


def _in_subsample(registered: Registered, few: Subsample) -> Registered:
    """The registered bodies in the frames of a subsample."""
    origins = zip(registered.origins, few.steps, strict=True)
    return replace(registered, bodies=few.bodies, origins=tuple(origin[::step] for origin, step in origins))


def _linear_solutions(
    registered: Registered, observations: Observations, sampled: SampledPath
) -> Callable[[Prior], tuple[tuple[Body, ...], FloatArray]]:
    """What gives bodies with points from the centre of mass, and x (p,), by linear least squares with a prior."""
    if registered.in_line:
        return partial(collinear_start, registered, observations, sampled)
    roots = [np.ones(len(body.frames)) for body in registered.bodies]
    even = drift_equations(registered, roots, sampled, registered.noise)
    return partial(_linear_solution, registered, observations, sampled, even)


def _linear_solution(
    registered: Registered, observations: Observations, sampled: SampledPath, even: DriftEquations, prior: Prior
) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies with points from the centre of mass, and x (p,), by linear least squares: unweighted (even), weighted.

    Where registration has rejected many observations, frames that the path passes by are weighed less: outliers in the
    eyes of a stereo rig spoil poses that seem to be as good as others.
    """
    roots = frame_roots(registered.bodies, observations, even.solved(prior).offsets)
    noise = registered.noise if observations.precision is None else 1.0
    drift = drift_equations(registered, roots, sampled, noise).solved(prior)
    for _ in range(SOFT_ROUNDS if _has_many_outliers(observations) else 0):
        soft = _softer(registered, roots, sampled, drift)
        drift = drift_equations(registered, soft, sampled, noise).solved(prior)
    moved = zip(registered.bodies, drift.offsets, strict=True)
    return tuple(replace(body, points=body.points + offset) for body, offset in moved), drift.x


def _softer(registered: Registered, roots: list[FloatArray], sampled: SampledPath, drift: Drift) -> list[FloatArray]:
    """The roots (n, 3, 3) of frames' weights for errors of a Cauchy distribution, by the median of the residuals."""
    position, squares = sampled.position(drift.x), []
    for body, origin, root, offset in zip(registered.bodies, registered.origins, roots, drift.offsets, strict=True):
        left = root @ (origin - body.attitude @ offset - position[body.frames])[:, :, None]
        squares.append(np.sum(left[:, :, 0] ** 2, axis=1))
    typical = max(float(np.median(np.concatenate(squares))), np.finfo(float).tiny)
    return [root / np.sqrt(1 + own / typical)[:, None, None] for root, own in zip(roots, squares, strict=True)]


def _has_many_outliers(observations: Observations) -> bool:
    """Whether registration with covariances has rejected many of the observations."""
    return observations.precision is not None and rejects_many(observations.weight)
