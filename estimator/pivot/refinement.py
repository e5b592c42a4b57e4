"""Iteration of the Gauss–Newton steps and the robust weights from an initial solution to convergence."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.evidence import Linear, complexity, held, maximise
from baryscope.estimator.adjustment.integration import posterior
from baryscope.estimator.adjustment.lasting_errors import frames_per_error
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.position_noise import position_variance
from baryscope.estimator.adjustment.reweighting import GATE, reweighted
from baryscope.estimator.adjustment.stereo import moved_to, varies_with_range
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.dynamics.interpolated_path import interpolated
from baryscope.estimator.dynamics.paths import Path, SampledPath
from baryscope.estimator.dynamics.prior import Prior
from baryscope.estimator.dynamics.process_noise import MOST_MODES, Disturbed
from baryscope.estimator.dynamics.seen import as_seen
from baryscope.estimator.dynamics.trajectory import smooth_in
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.few_features import with_few_features
from baryscope.estimator.pivot.found import LastStep, Pivot, spurious_of_known
from baryscope.estimator.pivot.free_attitudes import (
    MOST_HALVINGS,
    Linearised,
    Solution,
    StepStart,
    linearised,
    squares_of_used,
)
from baryscope.estimator.pivot.lost_bodies import brought_back_bodies
from baryscope.estimator.pivot.offset_prior import CONTRADICTED, Holding, Plain
from baryscope.estimator.pivot.tie_points import tie_bodies
from baryscope.estimator.registration.body import Body
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MAX_ROUNDS = 30
WANDERING = 12  # rounds after which steps, with weights that are at rest, follow noise in a direction that is not told
FIRM_ROUNDS = 15  # more, at most, once the prior of the offsets holds these against spurious information
STEP_TOLERANCE = 0.1  # squared length of the last step, in units of the covariance of all unknowns
ROUNDING = 1e-10  # relative to the distance: residuals below this are rounding errors
SLIP_TOLERANCE = 0.1  # relative change of the variance of a slipping position
LASTING_TOLERANCE = 0.1  # relative change of the number of frames with the same errors
SHIFT_TOLERANCE = 0.01  # relative change of an observation's variance, over which the frames' shifts are told
SIMPLE_ROUNDS = 6  # iterations with a simple path, at most, in which the weights settle
FREE_ROUNDS = 10  # iterations after which changes of the weights are damped
WEIGHT_CHANGE_TOLERANCE = 1e-2  # relative change of the cost by the last change of weights
SUBSAMPLE_FRAMES = 3000  # frames, approximately, for the initial solution, the degree and the spurious information
OMITTED = 0.01  # of the variance: more than that of the modes left out
SEEN = 0.1  # variance of degrees left out times information on a coefficient, from which the tracks see them
MIN_BODY_FRAMES = 20  # frames of each body that a subsample keeps


@dataclass(frozen=True, eq=False)
class Start:
    """The initial solution of the refinement.

    path, and sampled at the tracks' times (n,) in s; shapes: the points (m, 3) of each body as registered, m from their
    centroid; bodies with points from the centre of mass, and the path's x; measured: all observations; observations:
    those of bodies in their frames; inliers (n, m): which passed screening. lasting: how many frames have the same
    errors of the features, as the registered bodies tell; variance: of an observation of weight 1, as these tell;
    errors: of the camera at the times; first_prior: of a simple path, which holds until the weights have settled;
    slips: whether the position may have white noise, as that of a
    pivot that slips.
    """

    path: Path
    sampled: SampledPath
    time: FloatArray
    shapes: tuple[FloatArray, ...]
    bodies: tuple[Body, ...]
    x: FloatArray
    measured: Observations
    observations: Observations
    inliers: BoolArray
    lasting: float = 1.0
    variance: float = 0.0
    errors: SharedErrors | None = None
    first_prior: Prior | None = None
    slips: bool = False


@dataclass(frozen=True, eq=False)
class Subsample:
    """A subsample of bodies and observations: rows (k,) are the frames kept, every steps-th of each body."""

    bodies: tuple[Body, ...]
    observations: Observations
    rows: IntArray
    steps: tuple[int, ...]


def refined(start: Start, options: PathOptions) -> Pivot:
    """The solution of Gauss–Newton steps until steps and changes of the weights are small, with tie points applied.

    Raises:
        ComputationError: too few values for the unknowns.
    """
    path, measured, observations = start.path, start.measured, start.observations
    bodies, x = start.bodies, start.x
    sampled = as_seen(path, start.sampled, start.errors, x)
    theta: FloatArray | None = None
    simple, slip, lasting, brought_back, extended = start.first_prior, 0.0, start.lasting, False, False
    scan = True  # the whole ranges of several hyperparameters, in the first round and in the last
    converged, rounds, variance, floor = False, 0, np.nan, least_variance(measured, ROUNDING)
    stereo = varies_with_range(measured, options.noise)
    here, halvings = None, 0
    holding, most, path_unknowns = Holding.of(start.bodies), MAX_ROUNDS, np.nan
    solution: Solution | None = None
    last: LastStep | None = None
    plain: Plain | None = None
    while not converged and rounds < most:
        rounds += 1
        if stereo:
            observations = moved_to(observations, measured, _points_in_C(bodies, sampled.position(x), measured))
        told = lasting * max(options.sigma**2 if options.sigma else variance, floor)
        shift = _shift(start.errors, sampled.position(x), slip, told)
        of_frame = max(start.variance if np.isnan(variance) else variance, floor)
        offsets = holding.information(of_frame, lasting)
        problem = linearised(bodies, observations, sampled, x, shift, offsets)
        last_one = halvings == MOST_HALVINGS or rounds == most  # which ends with a step
        if here is not None and not last_one and here.is_worse(problem, observations.weight):
            # The linearised problem does not hold as far as the step went.
            halvings, (bodies, x) = halvings + 1, here.halfway(bodies, x)
            sampled = as_seen(path, sampled.itself, start.errors, x)
            continue
        halvings = 0
        cost = float(problem.squares.sum())
        if np.isnan(variance):
            variance = cost / _dof(bodies, observations, float(path.prior.free.sum()))
        prior = path.prior if simple is None else simple
        together = lasting * max(variance, floor)
        theta = maximise(scaled(problem, together), prior, None if scan else theta)
        solution = stepped(problem, prior, theta, together)
        bodies, x = solution.bodies, solution.x
        sampled = as_seen(path, sampled.itself, start.errors, x)
        if holding.firm is None:  # else what holds the offsets tells some
            path_unknowns = float(np.vdot(solution.covariance, problem.matrix))
        dof = _dof(bodies, observations, path_unknowns)
        variance = (cost + problem.noise_cost) / dof
        if measured.precision is not None:
            precision = held(scaled(problem, together), prior, theta)[0]
            here = StepStart(problem, observations.weight, max(variance, floor), lasting, precision)
        weight = reweighted(solution.squares, observations.weight, dof, floor)
        if rounds > FREE_ROUNDS:  # damping makes oscillating weights converge
            weight = np.sqrt(weight * observations.weight)
        least = max(variance, floor)
        unweighted = solution.squares / np.where(weight > 0, observations.weight, 1.0)
        changed = abs(float(np.vdot(unweighted, weight)) - cost)
        faster = last is not None and solution.step > last.decrease
        last = LastStep(
            solution.step,
            problem.offset_change(solution),
            # The first round knows neither weights nor variance.
            rounds > 1 and changed <= WEIGHT_CHANGE_TOLERANCE * max(cost, floor * dof),
        )
        settled = last.steady and last.decrease <= STEP_TOLERANCE * least
        observations = observations.weighted(weight)
        scan, converged = settled, settled and simple is None and (scan or len(prior.hyperparameters) < 2)
        if simple is not None:
            scan = settled or rounds >= SIMPLE_ROUNDS
            simple, here = (None, None) if scan else (simple, here)
        if converged and not brought_back and rounds < most:
            near = brought_back_bodies(
                bodies, observations.weight, (start.bodies, start.shapes), start.observations, sampled.position(x)
            )
            if near is not None:
                (bodies, weight), brought_back, converged, here = near, True, False, None
                observations = observations.weighted(weight)
        if converged and not extended and rounds < most:
            extended = True
            spurious = partial(spurious_of_known, bodies, observations, sampled.position(x), least, shift)
            more = with_few_features(solution, observations.weight, measured, sampled, lasting * least, spurious)
            if more is not None:
                (bodies, weight), converged, here = more, False, None
                observations = observations.weighted(weight)
        if converged and rounds < most and (richer := _richer(path, solution, theta, together, sampled)) is not None:
            path, converged, here = richer, False, None
            x = np.pad(x, (0, path.size - len(x)))
            sampled = as_seen(path, interpolated(path.at, path.frequency, start.time), start.errors, x)
        if converged and start.slips:
            found_slip = position_variance(bodies, observations, sampled.position(x), least)
            converged = abs(found_slip - slip) <= SLIP_TOLERANCE * max(found_slip, slip)
            slip = found_slip
        if converged:
            found_lasting = frames_per_error(bodies, observations, sampled.position(x))
            converged = abs(found_lasting - lasting) <= LASTING_TOLERANCE * max(found_lasting, lasting)
            here = here if converged else None
            lasting = found_lasting
        if converged and shift is not None and options.sigma is None:
            converged = abs(lasting * variance - told) <= SHIFT_TOLERANCE * told
        # Steps that become longer lead to a place that the tracks do tell.
        wandering = holding.firm is None and simple is None and last.steady and not faster and rounds >= WANDERING
        contradicted = plain is not None and cost > plain.cost + CONTRADICTED * lasting * least
        if converged or wandering or contradicted:
            spurious = partial(spurious_of_known, bodies, observations, sampled.position(x), least, shift)
            if plain is not None and plain.is_told(problem.bodies, cost, lasting * least, spurious):
                bodies, x = plain.bodies, np.pad(plain.x, (0, path.size - len(plain.x)))
                plain, converged, here = None, False, None
                holding, most = holding.of_prior_alone(), rounds + MAX_ROUNDS
                sampled = as_seen(path, sampled.itself, start.errors, x)
            # Not before: far from the solution, and with outliers, what is told may seem spurious.
            elif converged or wandering:
                firmer = holding.firmer(least, lasting, solution.offset_covariance, offsets, spurious)
                if firmer is not None:
                    plain = Plain.of(bodies, x, cost, spurious) if holding.firm is None else plain
                    holding, converged, here, most = firmer, False, None, rounds + FIRM_ROUNDS
    assert solution is not None and last is not None  # noqa: S101, PT018  there was a round
    scale = options.sigma**2 if options.sigma is not None else variance
    together = lasting * max(scale, floor)
    linear = scaled(problem, together)
    assert theta is not None  # noqa: S101  there was a round
    found = posterior(linear, path.prior, theta)
    solution = solution.with_covariance(found.covariance / together, problem.bodies)
    solution, tied, refused = tie_bodies(
        solution, together, observations, sampled.position(x), shift, frame_variance=max(scale, floor)
    )
    return Pivot(
        path=path,
        sampled=sampled,
        inliers=start.inliers,
        solution=solution,
        observations=observations,
        frame_variance=scale,
        residual_variance=variance,
        lasting=lasting,
        shift=shift,
        posterior=found,
        path_unknowns=path_unknowns,
        converged=converged,
        rounds=rounds,
        holding=holding,
        offsets=offsets,
        slip=float(np.sqrt(slip)),
        tie_points=tied,
        refused=refused,
        last=last,
    )


def _shift(errors: SharedErrors | None, origin: FloatArray, slip: float, variance: float) -> FloatArray | None:
    """The covariance (n, 3, 3) of the frames' shifts, over a variance in m² or 1.

    They are due to noise of the camera's attitude and to slip, white noise of the position of this variance in m².
    """
    noisy = errors is not None and errors.noisy
    if not (noisy or slip > 0) or not np.isfinite(variance):
        return None
    slipping = np.broadcast_to(slip * np.eye(3), (len(origin), 3, 3))
    return (slipping if errors is None or not noisy else slipping + errors.shift_covariance(origin)) / variance


def stepped(problem: Linearised, prior: Prior, theta: FloatArray, variance: float) -> Solution:
    """A step with given hyperparameters (h,)."""
    return problem.step(variance * held(scaled(problem, variance), prior, theta)[0])


def scaled(problem: Linearised, variance: float) -> Linear:
    """The reduced problem in the unknowns of the path, for a variance of an observation of weight 1."""
    return Linear(problem.matrix / variance, problem.rhs / variance, problem.x)


def bounded_cost(
    problem: Linearised,
    weight: FloatArray,
    variance: float,
    prior: Prior,
    theta: FloatArray | None = None,
    gate: float = GATE,
) -> float:
    """−2 ln of the marginal likelihood of a solution, up to a constant, with outliers of a bounded cost.

    An observation that is not used costs as much as any outlier. weight (n, m): robust; variance: of an observation of
    weight 1; theta (h,): hyperparameters from which those of the greatest likelihood are sought; gate: the cost of an
    outlier.
    """
    gained = np.minimum(squares_of_used(problem, weight) / variance - gate, 0.0)
    return float(gained.sum()) + complexity(scaled(problem, variance), prior, theta)


def _richer(path: Path, solution: Solution, theta: FloatArray, variance: float, sampled: SampledPath) -> Path | None:
    """The path with twice the modes of process noise if those left out matter; None if they do not."""
    if not isinstance(path, Disturbed) or path.count >= MOST_MODES:
        return None
    density = path.density if path.density is not None else float(np.exp(theta[-1]))
    least = OMITTED * _typical(sampled.covariance(variance * solution.covariance))
    return path.with_modes(2 * path.count) if path.omitted_variance(density) > least else None


def is_cut_short(found: Pivot) -> bool:
    """Whether a smooth path has degrees beyond its highest that matter."""
    smooth = smooth_in(found.path)
    if smooth is None:
        return False
    own = found.posterior.theta[: len(smooth.prior.hyperparameters)]
    # In some directions the path is told far better than its places are, as where its offset is hardly known.
    information = found.posterior.information[smooth.size - 3 : smooth.size].max()
    return smooth.omitted_variance(own) * float(information) > SEEN


def _typical(covariance: FloatArray) -> float:
    """The median variance of a coordinate over n times, for covariances (n, 3, 3)."""
    return float(np.median(np.trace(covariance, axis1=1, axis2=2))) / 3


def values_for_path(bodies: tuple[Body, ...], observations: Observations) -> float:
    """Number of values less all unknowns except the path's.

    A frame has three unknowns of its rotation, a body three of each point less three of its orientation.
    """
    frames = sum(len(body.frames) for body in bodies)
    points = sum(3 * len(body.features) - 3 for body in bodies)
    return 3 * float(observations.weight.sum()) - 3 * frames - points


def _dof(bodies: tuple[Body, ...], observations: Observations, path_size: float) -> float:
    """The degrees of freedom: number of values less that of all unknowns."""
    dof = values_for_path(bodies, observations) - path_size
    if dof <= 0:
        frames = sum(len(body.frames) for body in bodies)
        raise ComputationError(
            f"{counted(frames, 'frame that shows', 'frames that show')} an attitude, with "
            f"{counted(observations.count, 'observation')}: too few for a path of {path_size:.3g} unknowns",
            Reason.TOO_FEW_FRAMES,
        )
    return dof


def _points_in_C(bodies: tuple[Body, ...], origin: FloatArray, measured: Observations) -> FloatArray:
    """The estimated positions (n, m, 3) in C, m; the measured ones where no body has the feature."""
    estimated = measured.position.copy()
    for body in bodies:
        image = body.points @ np.swapaxes(body.attitude, 1, 2) + origin[body.frames][:, None]
        estimated[np.ix_(body.frames, body.features)] = image
    return estimated


def least_variance(observations: Observations, rounding: float) -> float:
    """The variance of rounding for an observation of weight 1; rounding: relative to the greatest distance."""
    if observations.precision is not None:
        return 1e-9
    position = observations.position
    return rounding**2 * float(np.einsum("kmi,kmi->km", position, position).max(initial=0.0))


def subsampled(bodies: tuple[Body, ...], observations: Observations, most: int) -> Subsample:
    """A subsample of about `most` of the bodies' frames, with at least MIN_BODY_FRAMES of each body."""
    every = max(1, sum(len(body.frames) for body in bodies) // most)
    steps = tuple(max(1, min(every, len(body.frames) // MIN_BODY_FRAMES)) for body in bodies)
    rows = np.sort(np.concatenate([body.frames[::step] for body, step in zip(bodies, steps, strict=True)]))
    few = tuple(
        replace(body, frames=np.searchsorted(rows, body.frames[::step]), attitude=body.attitude[::step])
        for body, step in zip(bodies, steps, strict=True)
    )
    return Subsample(few, observations.frames(rows), rows, steps)
