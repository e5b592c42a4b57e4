"""Bodies and path at the least squares of all observations, with an attitude for each frame: from a start to rest."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import reweighted
from baryscope.estimator.adjustment.stereo import moved_to
from baryscope.estimator.dynamics.paths import Path, SampledPath
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.drift import frame_weights, solve_drift
from baryscope.estimator.pivot.free_attitudes import Solution, gauss_newton_step
from baryscope.estimator.pivot.tie_points import TiePoints, tie_bodies
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.clusters import Registered
from baryscope.estimator.result import Finding
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ROUNDS = 30
SETTLED = 0.1  # a step this long, squared, in units of the covariance of all unknowns, is the last
# The first step from the start leaves less than this share of its own length, squared: with more frames than
# unknowns by far there is no need for a second one to see it.
CONTRACTION = 1e-5
ROUNDING = 1e-10  # of the distance: residuals smaller than this are none
HASTY = 6  # rounds in which weights may change at will
UNRULY = 1e-2  # share of the cost that the last change of weights may take away
FEW_FRAMES = 3000  # frames at most, or so, that a start is found by, a degree, and what attitude noise seems to show
LEAST_FRAMES = 20  # of a body, that are not left out for another's sake


@dataclass(frozen=True, eq=False)
class Start:
    """What the refinement starts from.

    path, sampled at the tracks' times; bodies with points seen from the centre of mass, and the path's x; measured: the
    observations as they came; observations: those that bodies can explain; inliers (n, m): which passed the screening.
    """

    path: Path
    sampled: SampledPath
    bodies: tuple[Body, ...]
    x: FloatArray
    measured: Observations
    observations: Observations
    inliers: BoolArray


@dataclass(frozen=True, eq=False)
class Pivot:
    """What `pivot` finds, for `ml` to start from.

    path and its unknowns x; inliers (n, m): which observations passed the screening; bodies with points seen from the
    centre of mass; observations with their weights, all (n, m); variance of an observation of weight 1, as given or as
    the residuals show it, over the given covariance or in m²; residual_variance: as they show it. tie_points between
    bodies that share features, and those refused because the features differ; findings: what does not fit.
    """

    path: Path
    sampled: SampledPath
    inliers: BoolArray
    solution: Solution
    observations: Observations
    variance: float
    residual_variance: float
    converged: bool
    rounds: int
    tie_points: tuple[TiePoints, ...]
    refused: tuple[TiePoints, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, points in m from the centre of mass."""
        return self.solution.bodies


@dataclass(frozen=True, eq=False)
class Thinned:
    """Bodies and observations in a few of their frames: rows (k,), every steps-th of each body."""

    bodies: tuple[Body, ...]
    observations: Observations
    rows: IntArray
    steps: tuple[int, ...]


def linear_start(
    registered: Registered, observations: Observations, path: Path, time: FloatArray
) -> tuple[tuple[Body, ...], FloatArray]:
    """Bodies and path to refine: by linear least squares; of many frames, some are solved, and refined once."""
    few = thinned(registered.bodies, observations, FEW_FRAMES)
    sampled = path.at(time[few.rows])
    bodies, x = linear_solution(in_few(registered, few), few.observations, sampled)
    if len(few.rows) < sum(len(body.frames) for body in registered.bodies):
        solution = gauss_newton_step(bodies, few.observations, sampled, x)
        bodies, x = solution.bodies, solution.x
    both = zip(registered.bodies, bodies, strict=True)
    return tuple(replace(body, points=refined.points) for body, refined in both), x


def in_few(registered: Registered, few: Thinned) -> Registered:
    """What registration found, in a few of the frames only."""
    origins = zip(registered.origins, few.steps, strict=True)
    return Registered(few.bodies, tuple(origin[::step] for origin, step in origins), registered.noise)


def linear_solution(
    registered: Registered, observations: Observations, sampled: SampledPath
) -> tuple[tuple[Body, ...], FloatArray]:
    """The path and the bodies seen from the centre of mass, by linear least squares, weighted the second time."""
    first = solve_drift(registered, [np.ones(len(body.frames)) for body in registered.bodies], sampled)
    drift = solve_drift(registered, frame_weights(registered.bodies, observations.weight, first.offsets), sampled)
    moved = zip(registered.bodies, drift.offsets, strict=True)
    return tuple(replace(body, points=body.points + offset) for body, offset in moved), drift.x


def refined(start: Start, options: PathOptions) -> Pivot:
    """Gauss–Newton steps until they are short and the weights at rest, then the tie points.

    Raises:
        ComputationError: too few values for the unknowns.
    """
    sampled, measured, observations = start.sampled, start.measured, start.observations
    bodies, x = start.bodies, start.x
    converged, rounds, variance, floor = False, 0, np.nan, least_variance(measured, ROUNDING)
    while not converged and rounds < ROUNDS:
        rounds += 1
        if measured.precision is not None and options.noise == "stereo":
            observations = moved_to(observations, measured, _points_in_C(bodies, sampled.position(x), measured))
        solution = gauss_newton_step(bodies, observations, sampled, x)
        bodies, x = solution.bodies, solution.x
        dof = _dof(bodies, observations, len(x))
        cost = float(solution.squares.sum())
        variance = cost / dof
        weight = reweighted(solution.squares, observations.weight, dof, floor)
        if rounds > HASTY:  # weights that swing to and fro come to rest in between
            weight = np.sqrt(weight * observations.weight)
        least = max(variance, floor)
        short = solution.step <= SETTLED * least
        if rounds == 1 and measured.precision is None:
            short = CONTRACTION * solution.step <= SETTLED * least
        plain = solution.squares / np.where(weight > 0, observations.weight, 1.0)
        converged = short and abs(float(np.vdot(plain, weight)) - cost) <= UNRULY * max(cost, floor * dof)
        observations = observations.weighted(weight)
    scale = options.sigma**2 if options.sigma is not None else variance
    solution, made, refused = tie_bodies(solution, max(scale, floor))
    return Pivot(
        path=start.path,
        sampled=sampled,
        inliers=start.inliers,
        solution=solution,
        observations=observations,
        variance=scale,
        residual_variance=variance,
        converged=converged,
        rounds=rounds,
        tie_points=made,
        refused=refused,
    )


def values_for_path(bodies: tuple[Body, ...], observations: Observations) -> float:
    """Values less all unknowns but the path's: a frame's rotation takes three, a body's points three each but for its
    turn."""
    frames = sum(len(body.frames) for body in bodies)
    points = sum(3 * len(body.features) - 3 for body in bodies)
    return 3 * float(observations.weight.sum()) - 3 * frames - points


def _dof(bodies: tuple[Body, ...], observations: Observations, path_size: int) -> float:
    """Values less all unknowns."""
    dof = values_for_path(bodies, observations) - path_size
    if dof <= 0:
        frames = sum(len(body.frames) for body in bodies)
        raise ComputationError(
            f"{counted(frames, 'frame that shows', 'frames that show')} an attitude, with "
            f"{counted(observations.count, 'observation')}: too few for a path of {path_size} unknowns",
            Reason.TOO_FEW_FRAMES,
        )
    return dof


def _points_in_C(bodies: tuple[Body, ...], origin: FloatArray, measured: Observations) -> FloatArray:
    """Where the points are estimated to be, (n, m, 3) in C; where they were measured if no body has them."""
    estimated = measured.position.copy()
    for body in bodies:
        image = body.points @ np.swapaxes(body.attitude, 1, 2) + origin[body.frames][:, None]
        estimated[np.ix_(body.frames, body.features)] = image
    return estimated


def least_variance(observations: Observations, rounding: float) -> float:
    """Of an observation of weight 1, that of rounding to this share of the farthest distance."""
    if observations.precision is not None:
        return 1e-9
    position = observations.position
    return rounding**2 * float(np.einsum("kmi,kmi->km", position, position).max(initial=0.0))


def thinned(bodies: tuple[Body, ...], observations: Observations, most: int) -> Thinned:
    """Bodies and observations in `most` of their frames or a few more: of each body some."""
    every = max(1, sum(len(body.frames) for body in bodies) // most)
    steps = tuple(max(1, min(every, len(body.frames) // LEAST_FRAMES)) for body in bodies)
    rows = np.sort(np.concatenate([body.frames[::step] for body, step in zip(bodies, steps, strict=True)]))
    few = tuple(
        replace(body, frames=np.searchsorted(rows, body.frames[::step]), attitude=body.attitude[::step])
        for body, step in zip(bodies, steps, strict=True)
    )
    return Thinned(few, observations.frames(rows), rows, steps)
