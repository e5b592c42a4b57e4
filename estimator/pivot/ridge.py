"""What a covariance leaves out where it is wide: the likeliest solutions along a direction lie on a curve.

A spin axis that is known to half a degree is off by centimetres at a place metres along it, and the path and the bodies
that fit best with a centre of mass there follow. The covariance has the tangent of this ridge of the posterior density
only. So the ridge is followed either way, as far as the outer nodes of a Gaussian quadrature, and the distances of its
points from the tangent are added (the points of Julier and Uhlmann, Proc. IEEE 92, 2004, that are optimal instead of
transformed). It is a curve in path and offsets with all other unknowns at their best, but for the place along wider
directions, which stays; weights and hyperparameters are as found.

Steps creep there: the noise of the attitudes does not make the cost steeper, on average, so that the matrix of Gauss
and Newton is too large along offsets of bodies by the spurious information in it. Where that is most of it, each step
comes nearer to the minimum by a small share of the way only: dozens of nearly equal steps would be needed. Along the
last step the change of the next one shows the curvature over that of the matrix; divided by it, the step is that of the
secant method.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import FrameShifts, shifts_in
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.spurious import RANK
from baryscope.estimator.adjustment.subsample import SUBSAMPLE_FRAMES, subsampled
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.geometry.extent import rms_radius
from baryscope.estimator.geometry.symmetric import factor_of
from baryscope.estimator.hyperparameters.evidence import held
from baryscope.estimator.observability import UNOBSERVABLE
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.free_attitudes import Linearised, Solution, linearised
from baryscope.estimator.pivot.joint_covariance import JointCovariance
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.reduced import scaled
from baryscope.estimator.pivot.refinement import STEP_TOLERANCE
from baryscope.estimator.registration.body import Body
from baryscope.models.errors import ComputationError

FloatArray = NDArray[np.float64]

NODE, NODE_WEIGHT = np.sqrt(3.0), 1 / 6  # the outer two of three nodes of a quadrature for a unit Gaussian
MOST_RIDGES = 3  # that are followed: those of the widest directions
MOST_STRETCHES = 6  # in which a ridge is followed to its node, with those that were too long
MOST_STEPS = 12  # at the end of a stretch
HELD = 1e6  # information on the place along a direction, in its standard deviations, that holds it
LEAST = 0.1  # of the curvature over that of Gauss and Newton's matrix: a step is lengthened tenfold at most
CREEPING = 0.7  # of it, from which steps are long enough
ALIGNED = 0.7  # cosine between a step and the last one, either way, from which it goes on along it


@dataclass(frozen=True, eq=False)
class _Directions:
    """Principal directions of the path's covariance where frames show an attitude, the widest first.

    widths (d,): rms deviations of the path, m; along (3 k + p, d): one standard deviation of the bodies' offsets and x;
    measures (d, p): their products with a change of x are its standard deviations along the directions.
    """

    widths: FloatArray
    along: FloatArray
    measures: FloatArray


@dataclass(frozen=True, eq=False)
class _Place:
    """A solution on a ridge: bodies, with points from the centre of mass, and x (p,)."""

    bodies: tuple[Body, ...]
    x: FloatArray

    def from_other(self, other: "_Place") -> FloatArray:
        """The change (3 k + p,) of offsets and x from another solution, in axes attached to its points."""
        pairs = zip(self.bodies, other.bodies, strict=True)
        changes = [_turned_centroid(one, own) - own.points.mean(axis=0) for one, own in pairs]
        return np.concatenate([*changes, self.x - other.x])


def with_ridges(found: PivotSolution, covariance: JointCovariance) -> JointCovariance:
    """The covariance of a solution, wider by how the ridges of its widest directions depart from their tangents.

    Those are directions that are not observable. Where a ridge can't be followed to the node, it departs as much more
    there as the node is farther. What departs by more than the width of the direction is as long as that.
    """
    shown = np.zeros(len(found.time), dtype=bool)
    for body in found.bodies:
        shown[body.frames] = True
    square = found.sampled.itself.frames_at(np.flatnonzero(shown)).mean_square()
    wide = _wide_directions(found, covariance, square)
    if not len(wide.widths):
        return covariance
    few, size, columns = _SubsampledSolution.of(found, wide), len(found.solution.x), []
    for index, width in enumerate(wide.widths):
        for departure in few.departures(index):
            length = np.sqrt(max(float(departure[-size:] @ square @ departure[-size:]), 0.0))
            longest = NODE * width
            columns.append(departure * (longest / length) if length > longest else departure)
    return covariance.grown(np.sqrt(NODE_WEIGHT) * np.transpose(columns)) if columns else covariance


def _wide_directions(found: PivotSolution, covariance: JointCovariance, square: FloatArray) -> _Directions:
    """The directions that are not observable, at most MOST_RIDGES; square (p, p): the mean of JᵀJ over the frames."""
    radius = rms_radius(max(found.bodies, key=lambda body: len(body.frames)).points)
    factor = factor_of(covariance.of_x)
    squares, axes = np.linalg.eigh(factor.T @ square @ factor)
    widths, axes = np.sqrt(np.maximum(squares, 0.0))[: -MOST_RIDGES - 1 : -1], axes[:, : -MOST_RIDGES - 1 : -1]
    wide = widths > UNOBSERVABLE * radius
    measures = axes[:, wide].T @ np.linalg.pinv(factor)
    along = np.concatenate([covariance.offsets_x @ measures.T, factor @ axes[:, wide]])
    return _Directions(widths[wide], along, measures)


@dataclass(frozen=True, eq=False)
class _SubsampledSolution:
    """A solution with some of its frames, each with the weight of those it stands for."""

    found: PivotSolution
    wide: _Directions
    start: _Place
    observations: Observations
    path: SampledPath
    shifts: FrameShifts | None

    @classmethod
    def of(cls, found: PivotSolution, wide: _Directions) -> "_SubsampledSolution":
        """A solution with a subsample of its frames; wide: the directions of its ridges."""
        few = subsampled(found.bodies, found.observations, SUBSAMPLE_FRAMES)
        observations, count = few.standing_for_all()
        shifts = shifts_in(found.shifts, few.rows, count)
        path = found.sampled.frames_at(few.rows)
        return cls(found, wide, _Place(few.bodies, found.solution.x), observations, path, shifts)

    def departures(self, index: int) -> list[FloatArray]:
        """The departures (3 k + p,) from a tangent at the nodes on either side, where the ridge can be followed."""
        begin = self._settled(np.zeros(index + 1), self.start)
        if begin is None:
            return []
        both = (self._departure(begin, index, sign) for sign in (-1.0, 1.0))
        return [departure for departure in both if departure is not None]

    def _departure(self, begin: _Place, index: int, sign: float) -> FloatArray | None:
        """The departure on one side, from the middle of the ridge; None where it can't be followed."""
        unit = sign * np.eye(index + 1)[index]
        place, reached, stretch = begin, 0.0, NODE
        for _ in range(MOST_STRETCHES):
            if reached >= NODE:
                break
            there = min(reached + stretch, NODE)
            further = self._settled(there * unit, place)
            if further is None:
                stretch /= 2
            else:
                reached, place = there, further
        if not reached > 0:
            return None
        tangent = sign * self.wide.along[:, index]
        return np.asarray((place.from_other(begin) - reached * tangent) * (NODE / reached))

    def _settled(self, target: FloatArray, place: _Place) -> _Place | None:
        """The best solution so many standard deviations (d,) along the widest directions, from one nearby.

        None if none is found.
        """
        found, variance, measures = self.found, self.found.variance, self.wide.measures[: len(target)]
        holding = HELD * variance * measures.T
        last: Step | None = None
        for step in range(MOST_STEPS):
            try:  # a step may lead to where no orbit is
                problem = linearised(
                    place.bodies, self.observations, self.path, place.x, self.shifts, found.offset_prior_information
                )
                precision = held(scaled(problem, variance), found.path.prior, found.posterior.theta)[0]
                there = replace(
                    problem,
                    matrix=problem.matrix + holding @ measures,
                    rhs=problem.rhs + holding @ (target - measures @ (place.x - found.solution.x)),
                    sizes=problem.sizes + np.einsum("pd,dp->p", holding, measures),
                )
                solution = there.step(variance * precision, whole=True)
            except ComputationError:
                return None
            if step and solution.decrease <= STEP_TOLERANCE * variance:
                return _Place(solution.bodies, solution.x)
            # The first step follows the ridge to the target, the second one comes back to it.
            longer = None if last is None or step == 1 else secant_step(there, solution, last)
            last = Step(there.bodies, there.x, there.offset_change(solution))
            end = solution if longer is None else longer
            place = _Place(end.bodies, end.x)
        return None


@dataclass(frozen=True, eq=False)
class Step:
    """Where a step began, bodies and x (p,), and by what it would have changed the offsets of the bodies, (3 k,) m."""

    bodies: tuple[Body, ...]
    x: FloatArray
    change: FloatArray


def secant_step(problem: Linearised, solution: Solution, last: Step) -> Solution | None:
    """The solution of a step that goes on along the way from the last place, as far as the secant tells.

    None where the step does not creep.
    """
    pairs = list(zip(problem.bodies, last.bodies, strict=True))
    way = np.concatenate([own.offset_by_points @ (own.points - then.points).ravel() for own, then in pairs])
    here = problem.offset_change(solution)
    metric = np.linalg.pinv(solution.offset_covariance, rcond=RANK, hermitian=True)
    by_way, length = metric @ way, float(way @ metric @ way)
    along = float(by_way @ here)
    if not along * along > ALIGNED**2 * length * float(here @ metric @ here):
        return None
    curvature = float(by_way @ (last.change - here)) / length
    if curvature > CREEPING:
        return None
    more = along / length * (1 / max(curvature, LEAST) - 1)
    moved = (
        replace(body, points=body.points + more * (own.points - then.points))
        for body, (own, then) in zip(solution.bodies, pairs, strict=True)
    )
    return replace(solution, x=solution.x + more * (problem.x - last.x), bodies=tuple(moved))


def _turned_centroid(body: Body, like: Body) -> FloatArray:
    """The centroid of a body's points from the centre of mass, in the axes of a similar body, (3,) in m."""
    axes = align(like.points[None], body.points[None], np.ones((1, len(body.points)))).rotation[0]
    return np.asarray(axes @ body.points.mean(axis=0))
