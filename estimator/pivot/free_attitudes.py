"""Least squares of rigid bodies whose common centre of mass moves on a path; the attitude is free in every frame.

Unknowns are the path's x, each body's points b (in its own axes S, origin at the centre of mass), and one rotation per
frame. The rotations are eliminated frame by frame and the points body by body, which leaves a system in the path's few
unknowns: the drifting pivot of docs/theory/pivot.md, c_k = g(t_k; x) + R_k d, with the weights of the joint adjustment.
Shifts of whole frames by noise of a known covariance, as that of a camera's attitude, are eliminated with the
rotations. The orientation of S is arbitrary; this gauge freedom is fixed by the minimum-norm change of the points.

Steps that lead uphill are halved. The linearised problem does not hold far away in directions that the tracks hardly
tell: errors of the attitudes times a change of the offset are of second order. A step of metres there may lead to where
nothing fits, given covariances; without these the weights of the first rounds, which still look for outliers, hold it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.elimination import AllFrames, eliminated
from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import REJECTED
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.geometry.gauge import are_in_line, offset_by_points
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import (
    eigen,
    inverse_across,
    inverse_and_null_space,
)
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.noise import GATE
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

WORSE = 0.01  # increase of −2 ln p, for each observation, from which a step was too long
MOST_HALVINGS = 5  # of one step
MAX_LENGTH = 1e12  # m from the chaser, or from the centre of mass: a thousand times farther than any observation


@dataclass(frozen=True, eq=False)
class Solution:
    """Bodies and path after one Gauss–Newton step. Covariances are for weights that are inverse variances.

    x (p,) and its covariance (p, p). For each body points_covariance (3 m, 3 m), conditional on x, and by_path
    (3 m, p): a change δx changes the points by −by_path δx. offset_covariance (3 k, 3 k): covariance of the offsets of
    the k bodies, their points' centroids from the centre of mass in axes attached to the points; offset_path (3 k, p):
    their covariance with x. null_space (p, d) and offset_null_space (3 k, d): unobserved directions, which
    the covariances leave out. squares (n, m): the weighted squared residuals before the step, 0 where nothing is used;
    decrease: that of their sum, as the step predicts it.
    """

    bodies: tuple[Body, ...]
    x: FloatArray
    covariance: FloatArray
    points_covariance: tuple[FloatArray, ...]
    by_path: tuple[FloatArray, ...]
    offset_covariance: FloatArray
    offset_path: FloatArray
    null_space: FloatArray
    offset_null_space: FloatArray
    squares: FloatArray
    decrease: float

    def moved_to(self, x: FloatArray) -> "Solution":
        """The solution with another x (p,), and the points that fit best with it."""
        change = x - self.x
        pairs = zip(self.bodies, self.by_path, strict=True)
        return replace(self, x=x, bodies=tuple(body.moved(-by_path @ change) for body, by_path in pairs))

    def with_covariance(self, covariance: FloatArray, attached: tuple[Body, ...] | None = None) -> "Solution":
        """The solution with another covariance (p, p) of x, and what follows from it.

        attached: the bodies whose points define the axes of the offsets; the solution's own unless given.
        """
        bodies = self.bodies if attached is None else attached
        maps = [body.offset_by_points for body in bodies]
        own = zip(maps, self.points_covariance, strict=True)
        by_x = np.concatenate([to @ by_path for to, by_path in zip(maps, self.by_path, strict=True)])
        return replace(
            self,
            covariance=covariance,
            offset_covariance=block_diag(*(to @ alone @ to.T for to, alone in own)) + by_x @ covariance @ by_x.T,
            offset_path=-by_x @ covariance,
            offset_null_space=-by_x @ self.null_space,
        )


@dataclass(frozen=True, eq=False)
class Linearised:
    """The least-squares problem linearised at x (p,) and the bodies' points, with the rotations eliminated.

    matrix (p, p) and rhs (p,) of the change of x, after the elimination of the points; sizes (p,): the matrix's
    diagonal before. For each body, with attitudes at their optimum: inverse (3 m, 3 m) of its points' matrix, by_path
    (3 m, p): a change δx changes the points by −by_path δx, points_rhs (3 m,), and told (m,): the points that hold the
    axes. squares (n, m): the weighted squared residuals, without the frames' own shifts; noise_cost: the weighted
    squares of these, and noise_volume: what their freedom costs, see `ReducedEquations`. offset_cost: the squares of
    the offsets, over their prior's variances.
    """

    bodies: tuple[Body, ...]
    x: FloatArray
    matrix: FloatArray
    rhs: FloatArray
    sizes: FloatArray
    inverse: tuple[FloatArray, ...]
    by_path: tuple[FloatArray, ...]
    points_rhs: tuple[FloatArray, ...]
    told: tuple[BoolArray, ...]
    squares: FloatArray
    noise_cost: float = 0.0
    noise_volume: float = 0.0
    offset_cost: float = 0.0

    def step(self, precision: FloatArray | None = None, *, whole: bool = False) -> Solution:
        """The solution after one step; precision (p,): inverse prior variances of x, in the units of the weights.

        It changes the shape of a body no more than it is large, unless the step is to be `whole`.

        Raises:
            ComputationError: x or a point is larger than MAX_LENGTH after the step, or not finite.
        """
        prior = np.zeros_like(self.x) if precision is None else precision
        matrix, rhs, sizes = self.matrix + np.diag(prior), self.rhs - prior * self.x, self.sizes + prior
        covariance, null_space = inverse_and_null_space(matrix, sizes)
        change = covariance @ rhs
        moved, decrease = [], float(change @ rhs)
        for body, inverse, by_path, points_rhs, told in zip(
            self.bodies, self.inverse, self.by_path, self.points_rhs, self.told, strict=True
        ):
            decrease += float(points_rhs @ inverse @ points_rhs)
            moves = inverse @ points_rhs - by_path @ change
            moved.append(body.moved(moves if whole else _limited(moves, inverse, body.points, told), told))
        unknowns = np.concatenate([self.x + change, *(body.points.ravel() for body in moved)])
        if not np.abs(unknowns).max() <= MAX_LENGTH:
            raise diverged()
        alone = Solution(
            bodies=tuple(moved),
            x=self.x + change,
            covariance=covariance,
            points_covariance=self.inverse,
            by_path=self.by_path,
            offset_covariance=np.zeros(0),
            offset_path=np.zeros(0),
            null_space=null_space,
            offset_null_space=np.zeros(0),
            squares=self.squares,
            decrease=decrease,
        )
        return alone.with_covariance(covariance, self.bodies)

    def offset_change(self, solution: Solution) -> FloatArray:
        """What a step changes the offsets of the k bodies by, (3 k,) m, in axes attached to the points."""
        pairs = zip(self.bodies, solution.bodies, strict=True)
        changes = [own.offset_by_points @ (moved.points - own.points).ravel() for own, moved in pairs]
        return np.concatenate(changes)


@dataclass(frozen=True, eq=False)
class StepStart:
    """The problem there, the weights (n, m) in it, the variance of an observation of weight 1 in a frame by itself, how
    many frames have the same errors, and the precision (p,) of the prior of x.
    """

    problem: Linearised
    weight: FloatArray
    variance: float
    lasting: float
    precision: FloatArray

    def is_worse(self, problem: Linearised, weight: FloatArray) -> bool:
        """Whether −2 ln p is clearly greater after the step, with outliers of a bounded cost."""
        most = max(WORSE * float(np.count_nonzero(weight)) / self.lasting, GATE)
        return self._cost(problem, weight) > self._cost(self.problem, self.weight) + most

    def halfway(self, bodies: tuple[Body, ...], x: FloatArray) -> tuple[tuple[Body, ...], FloatArray]:
        """The bodies and x (p,) halfway to those after the step."""
        pairs = zip(self.problem.bodies, bodies, strict=True)
        middle = tuple(replace(one, points=(one.points + other.points) / 2) for one, other in pairs)
        return middle, (self.problem.x + x) / 2

    def _cost(self, problem: Linearised, weight: FloatArray) -> float:
        # One that is rejected outright costs as much as any outlier: else a step to where nothing fits would be none.
        gained = np.minimum(squares_of_used(problem, weight) / self.variance - GATE, 0.0)
        observed = float(gained.sum()) + (problem.noise_cost + problem.offset_cost) / self.variance
        return observed / self.lasting + float(self.precision @ (problem.x * problem.x))


def squares_of_used(problem: Linearised, weight: FloatArray) -> FloatArray:
    """The squared residuals (k,) of the observations of any weight (n, m), in the units of the weights."""
    return np.asarray(problem.squares[weight > 0] / weight[weight > 0])


def diverged() -> ComputationError:
    """The error of a solution that is beyond MAX_LENGTH, or as uncertain."""
    return ComputationError(
        "the least squares of path and points diverge: the features do not move as rigid bodies or hardly turn",
        Reason.DIVERGED,
    )


def gauss_newton_step(
    bodies: tuple[Body, ...],
    observations: Observations,
    path: SampledPath,
    x: FloatArray,
    shifts: FrameShifts | None = None,
) -> Solution:
    """One Gauss–Newton step without a prior, see `linearised`."""
    return linearised(bodies, observations, path, x, shifts).step()


def linearised(
    bodies: tuple[Body, ...],
    observations: Observations,
    path: SampledPath,
    x: FloatArray,
    shifts: FrameShifts | None = None,
    offset_information: FloatArray | None = None,
) -> Linearised:
    """The problem linearised at x (p,) and points, after one Gauss–Newton step in the rotations at fixed x and points.

    bodies with points from the centre of mass; observations of all features (n, m); path sampled at all n frames;
    shifts: of these; offset_information (k, 3, 3): that of a prior of mean zero on the offset of each body, in the
    weights' units. It is that of the features that are told: one that nothing tells would take all of it.
    """
    turned, sums, squares = [], [], np.zeros_like(observations.weight)
    frames = AllFrames(path, path.position(x), shifts)
    for body in bodies:
        own, own_sums, own_squares = eliminated(body, observations.features(body.features), frames)
        turned.append(own)
        sums.append(own_sums)
        squares[body.block] = own_squares
    matrix, rhs, sizes = np.zeros((len(x), len(x))), np.zeros(len(x)), np.zeros(len(x))
    inverses, by_paths, offset_cost = [], [], 0.0
    every = [told_features(body, observations.weight) for body in turned]
    for index, (body, told, own_sums) in enumerate(zip(turned, every, sums, strict=True)):
        if offset_information is not None:
            by_points, offset = offset_by_points(body.points, told), body.points[told].mean(axis=0)
            own_sums.know(by_points.T @ offset_information[index], by_points, offset)
            offset_cost += float(offset @ offset_information[index] @ offset)
        turns = np.swapaxes(cross_matrices(body.points), 1, 2).reshape(-1, 3)  # δb = φ × b, of S
        held = None if told.all() else np.repeat(told, 3)
        inverse = inverse_across(own_sums.points, turns, own_sums.points_sizes, held)
        sizes += own_sums.path_sizes
        by_path = inverse @ own_sums.path_points.T
        matrix += own_sums.path - own_sums.path_points @ by_path
        rhs += own_sums.path_rhs - by_path.T @ own_sums.points_rhs
        inverses.append(inverse)
        by_paths.append(by_path)
    points_rhs = tuple(own_sums.points_rhs for own_sums in sums)
    return Linearised(
        bodies=tuple(turned),
        x=x,
        matrix=matrix,
        rhs=rhs,
        sizes=sizes,
        inverse=tuple(inverses),
        by_path=tuple(by_paths),
        points_rhs=points_rhs,
        told=tuple(every),
        squares=squares,
        noise_cost=sum(own_sums.noise_cost for own_sums in sums),
        noise_volume=sum(own_sums.noise_volume for own_sums in sums),
        offset_cost=offset_cost,
    )


def _limited(moves: FloatArray, inverse: FloatArray, points: FloatArray, told: BoolArray) -> FloatArray:
    """The moves (3 m,) of points (m, 3), which change the shape of those that are told no more than it is large.

    Along principal axes of their covariance, in `inverse` (3 m, 3 m): where parts of a body hardly tell how they stand
    to each other, the problem is not linear as far as a step would lead. What moves all points alike, it is.
    """
    some, own = points[told], np.repeat(told, 3)
    largest = float(np.linalg.norm(some - some.mean(axis=0)))
    if not np.linalg.norm(_of_shape(moves[None, own])) > largest:
        return moves
    _, axes = eigen(inverse[np.ix_(own, own)])
    along = axes.T @ moves[own]
    size = np.linalg.norm(_of_shape(axes.T), axis=1) * np.abs(along)
    limited = moves.copy()
    limited[own] = axes @ (along * np.minimum(1.0, largest / np.maximum(size, 1e-300)))
    return limited


def _of_shape(moves: FloatArray) -> FloatArray:
    """What moves (k, 3 m) of points change of their shape, (k, 3 m): without their mean."""
    own = moves.reshape(len(moves), -1, 3)
    return np.asarray((own - own.mean(axis=1, keepdims=True)).reshape(len(moves), -1))


def told_features(body: Body, weight: FloatArray) -> BoolArray:
    """The features (m,) of a body of which weights (n, m) do not reject all observations; all where these are too few,
    or in a line.
    """
    told = np.asarray((weight[body.block] >= REJECTED).any(axis=0))
    few = told.sum() < FEWEST_POINTS or (are_in_line(body.points[told]) and not are_in_line(body.points))
    return np.ones_like(told) if few else told
