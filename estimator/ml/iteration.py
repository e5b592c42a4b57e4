"""Damped Gauss–Newton steps to the maximum a posteriori estimate, with new robust weights and hyperparameters each."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.degrees_of_freedom import degrees_of_freedom_of_points
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import WEIGHT_CHANGE_TOLERANCE, reweighted
from baryscope.estimator.adjustment.stereo import StereoNoise
from baryscope.estimator.dynamics.inertia import of_a_body
from baryscope.estimator.dynamics.rotation import Attitudes, Rotation
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, conditional, held, maximise, ranges
from baryscope.estimator.ml.initial_tumble import MAX_NODES, NODES_PER_FRAME
from baryscope.estimator.ml.jacobians import Knots, worthwhile
from baryscope.estimator.ml.likelihood import Equations, equations
from baryscope.estimator.ml.model import FrameNoise, Model
from baryscope.estimator.ml.priors import Priors
from baryscope.estimator.paths.blocks import Blocks
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.progress import Rounds

FloatArray = NDArray[np.float64]

MAX_ROUNDS = 25  # of steps and new weights: what has not converged then says so
# After so many, squares of so many times those with free attitudes are of no tumble: as in a hand, where a torque that
# changes the rate many times over is followed in ever shorter steps.
PATIENCE, HOPELESS = 8, 300.0
DAMPING = 1e-8  # of the first step, over the diagonal: more slows down what tells rate from inertia in long tracks
MOST_DAMPING, STRONGER, WEAKER = 1e10, 10.0, 30.0  # after a step uphill it is so many times stronger, else weaker
UNDAMPED = 1e-2  # a step with more damping is short by that, and not as the iteration has converged
STEP_TOLERANCE = 1e-2  # squared length of the last step, in units of the covariance, and increase of −2 ln p by a step
ROUNDING = 1e-7  # relative to the distance: about the interpolation error of attitudes
STAGE = 0.5  # of the unit of progress, that the start, the tumble and each round take
FLAT = 7.0  # of a hyperparameter's logarithm, from its lower bound to where a mode's variance is that of its estimate


@dataclass(frozen=True, eq=False)
class State:
    """A rotation, its motion at the tracks' times, and the path's x (p,)."""

    rotation: Rotation
    motion: Attitudes
    x: FloatArray

    @property
    def values(self) -> FloatArray:
        """The unknowns (q,)."""
        return Priors.values(self.rotation, self.x)


@dataclass(frozen=True, eq=False)
class Problem:
    """What an iteration does not change: times (n,), path and priors.

    floor: least variance of an observation; lasting: how many frames have the same errors of the features;
    free_variance: of an observation, from the residuals with free attitudes; stereo: the noise of a stereo rig, if the
    covariances are its at the measured points.
    """

    time: FloatArray
    path: Path
    sampled: SampledPath
    blocks: Blocks
    noise: FrameNoise | None
    priors: Priors
    floor: float
    lasting: float
    free_variance: float
    stereo: StereoNoise | None

    @cached_property
    def path_at_knots(self) -> FloatArray | None:
        """The path's Jacobian (k, 3, p) at the knots of the blocks; None if it is not smooth, or knots are no help."""
        smooth = np.isfinite(self.path.frequency) and self.sampled.seen_of is None
        return self.path.at(self.blocks.knots.ravel()).jacobian if smooth and worthwhile(self.blocks) else None

    def model(self, state: State, points: FloatArray) -> Model:
        """What is seen of points (m, 3) at a state."""
        knots = None if self.path_at_knots is None else Knots(self.blocks, state.motion, self.path_at_knots)
        origin, turned = self.sampled.position(state.x), turned_by(self.sampled, state.x)
        return Model(state.motion, self.sampled, origin, points, self.noise, knots, turned)

    def equations(self, observations: Observations, state: State, points: FloatArray) -> Equations:
        """The normal equations at a state, linearised at points (m, 3)."""
        return equations(observations, self.model(state, points))

    def moved(self, state: State, change: FloatArray) -> State | None:
        """The state after a change (q,) of the unknowns; None if the rotation is not possible."""
        size = state.rotation.size
        rotation = state.rotation.changed(np.zeros(3), change[:size])
        if not rotation.possible:
            rotation = replace(rotation, inertia=of_a_body(rotation.inertia))
        near = rotation.reaches(self.time, MAX_NODES + NODES_PER_FRAME * len(self.time))
        motion = rotation.try_at(self.time) if near else None
        return None if motion is None else State(rotation, motion, state.x + change[size:])

    def with_weights(self, observations: Observations, state: State, points: FloatArray) -> Observations:
        """The observations, if `stereo` with the covariances of the estimated points (m, 3)."""
        if self.stereo is None:
            return observations
        model = self.model(state, points)
        estimated = points @ np.swapaxes(model.attitude, 1, 2) + model.origin[:, None]
        return self.stereo.moved_to(estimated, observations.weight)


@dataclass(frozen=True, eq=False)
class Iterate:
    """The result of an iteration; theta (h,): the hyperparameters; unknowns: how many the observations determine."""

    state: State
    observations: Observations
    equations: Equations
    variance: float
    theta: FloatArray
    unknowns: float = 0.0
    converged: bool = False
    rounds: int = 0


@dataclass(frozen=True, eq=False)
class _QuadraticModel:
    """The cost near an iterate, cost − 2 rhs·c + c·matrix c for a change c (q,) of the unknowns, with their prior.

    In the units of the observations' weighted squares. theta (h,): the likeliest hyperparameters; precision (q,): of
    the prior there; unknowns: how many the observations determine.
    """

    matrix: FloatArray
    rhs: FloatArray
    cost: float
    theta: FloatArray
    precision: FloatArray
    unknowns: float

    @classmethod
    def of(cls, problem: Problem, at: Iterate) -> "_QuadraticModel":
        """The quadratic model about an iterate."""
        values, own = at.state.values, problem.priors.own
        linear = problem.priors.bounded(problem.priors.linear(at.equations, values, at.variance))
        theta = maximise(linear, own, _start(linear, own, at.theta))
        precision = held(linear, own, theta)[0]
        return cls(
            at.variance * (linear.information + np.diag(precision)),
            at.variance * (linear.rhs - precision * values),
            at.equations.cost + at.variance * problem.priors.cost(values, precision),
            theta,
            precision,
            len(values) - float(precision @ np.diag(conditional(linear, own, theta)[1])),
        )


@dataclass(frozen=True, eq=False)
class _Step:
    """A step downhill: the state and the equations after it; decrease: that of the cost by the undamped model;
    damping: of the next step.
    """

    state: State
    equations: Equations
    decrease: float
    damping: float


def iterated(problem: Problem, start: Iterate, done: Rounds) -> Iterate:
    """Damped Gauss–Newton steps until steps and changes of the weights are small, none leads downhill, or there is no
    hope.
    """
    at, damping = start, DAMPING
    while not at.converged and at.rounds < MAX_ROUNDS and not _is_hopeless(problem, at):
        done.did(STAGE)
        model = _QuadraticModel.of(problem, at)
        step = _step_downhill(problem, at, model, damping)
        at = replace(at, theta=model.theta, unknowns=model.unknowns, rounds=at.rounds + 1)
        if step is None:
            return at
        at, damping = _reweighted(problem, at, step), step.damping
    return at


def _is_hopeless(problem: Problem, at: Iterate) -> bool:
    """Whether an iterate is still so far from what free attitudes leave that it leads to no tumble."""
    seen = 3 * float(np.minimum(at.observations.weight, 1.0).sum())
    return at.rounds >= PATIENCE and at.equations.cost > HOPELESS * problem.free_variance * seen


def _step_downhill(problem: Problem, at: Iterate, model: _QuadraticModel, damping: float) -> _Step | None:
    """A step by the model, damped until it does not lead uphill; None if all do."""
    diagonal = np.diag(np.diag(model.matrix))
    while damping < MOST_DAMPING:
        change = symmetric_pseudo_inverse(model.matrix + damping * diagonal) @ model.rhs
        moved = problem.moved(at.state, change)
        if moved is not None:
            found = problem.equations(at.observations, moved, at.equations.points)
            reached = found.cost + at.variance * problem.priors.cost(moved.values, model.precision)
            if reached <= model.cost + STEP_TOLERANCE * at.variance:
                return _Step(moved, found, float(change @ model.matrix @ change), damping / WEAKER)
        damping *= STRONGER
    return None


def _reweighted(problem: Problem, at: Iterate, step: _Step) -> Iterate:
    """The iterate after a step with the variance there, and whether it has converged; if not, with new weights."""
    found, observations = step.equations, at.observations
    dof = degrees_of_freedom_of_points(observations, at.unknowns)
    of_frame = max(found.cost / dof, problem.floor)
    variance = problem.lasting * of_frame
    weight = reweighted(found.squares, observations.weight, dof, problem.floor)
    unweighted = found.squares / np.where(weight > 0, observations.weight, 1.0)
    reduced = float(np.vdot(unweighted, weight) - found.squares.sum())
    steady = abs(reduced) <= WEIGHT_CHANGE_TOLERANCE * of_frame * dof
    converged = steady and step.decrease <= STEP_TOLERANCE * variance and step.damping < UNDAMPED
    if not converged and (problem.stereo is not None or not steady):
        observations = problem.with_weights(observations.weighted(weight), step.state, found.points)
        found = problem.equations(observations, step.state, found.points)
    return replace(
        at, state=step.state, observations=observations, equations=found, variance=variance, converged=converged
    )


def _start(linear: GaussianLikelihood, own: Prior, theta: FloatArray) -> FloatArray:
    """The hyperparameters to start their search from, away from lower bounds, where the likelihood is flat.

    theta: those that are known, the last of them.
    """
    start = ranges(linear, own)[:, 0] + FLAT
    known = slice(len(start) - len(theta), None)
    start[known] = np.maximum(theta, start[known])
    return start


def turned_by(sampled: SampledPath, x: FloatArray) -> FloatArray | None:
    """The rotation vectors (n, 3) in C by which a camera with errors in x (p,) sees attitudes turned; None without."""
    return None if sampled.turn is None else sampled.turn @ x
