"""The joint covariance of a solution's path and bodies, without spurious information from the attitudes' noise."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.spurious import (
    OffsetPrior,
    farthest,
    feigned_columns,
    implausible_columns,
    spurious_information_columns,
    untold_decrease,
)
from baryscope.estimator.geometry.extent import rms_radius, rms_width
from baryscope.estimator.geometry.gauge import are_in_line
from baryscope.estimator.geometry.symmetric import factor_of
from baryscope.estimator.observability import UNOBSERVABLE
from baryscope.estimator.paths.burns import untold_durations
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.pivot.collinear import without_spurious_path
from baryscope.estimator.pivot.offset_prior import RADII
from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.pivot.refinement import STEP_TOLERANCE

FloatArray = NDArray[np.float64]

SPURIOUS = 0.02  # share of the information on an offset that is spurious, from which it matters
WIDE = 1.5  # rms distance from a line over a coordinate's noise, up to which that alone may make it
AT_ONE_END = 10.0  # radii of the features: deviation of an offset that is claimed where nothing tells it
CLAIMED = AT_ONE_END / RADII  # the same, over that of the prior that holds it
LINE = 0.1  # rms distance from a line over that along it, up to which it is nearly one


@dataclass(frozen=True, eq=False)
class JointCovariance:
    """A covariance (3 k + p, 3 k + p) of the offsets of k bodies, m, and of the path's x (p,)."""

    matrix: FloatArray
    bodies: int

    @property
    def of_x(self) -> FloatArray:
        """The covariance (p, p) of x."""
        return self.matrix[3 * self.bodies :, 3 * self.bodies :]

    @property
    def of_offsets(self) -> FloatArray:
        """The covariances (k, 3, 3) of each body's offset by itself, m²."""
        each = np.arange(self.bodies)
        own = self.matrix[: 3 * self.bodies, : 3 * self.bodies]
        return np.asarray(own.reshape(self.bodies, 3, self.bodies, 3)[each, :, each])

    @property
    def offsets_x(self) -> FloatArray:
        """The covariance (3 k, p) of the offsets with x."""
        return self.matrix[: 3 * self.bodies, 3 * self.bodies :]

    def grown(self, columns: FloatArray) -> "JointCovariance":
        """The covariance with A Aᵀ added, for columns A (3 k + p, d)."""
        return replace(self, matrix=self.matrix + columns @ columns.T)

    def displaced(self, distance: float, path: SampledPath) -> "JointCovariance":
        """The covariance with a displacement of the path, by itself, by a distance along each axis, m."""
        return self.grown(np.concatenate([np.zeros((3 * self.bodies, 3)), distance * _displacement(path)]))


def without_spurious_information(found: PivotSolution) -> JointCovariance:
    """The joint covariance of a solution without spurious information, with burns of untold durations."""
    whole = _without_spurious(found)
    return whole.grown(whole.matrix[:, 3 * whole.bodies :] @ untold_durations(found.path, whole.of_x))


def _without_spurious(found: PivotSolution) -> JointCovariance:
    """The same, but with untold durations held.

    The position along the axis of a pure spin is not observable, but the noise of the attitudes adds apparent
    information Σ (tr C − C), C a frame's covariance of attitude. It is subtracted, as far as it is known; what remains
    is that of the offsets' prior, and at least that of `farthest`. Where it matters, products of errors are counted,
    too: of offsets as most are, as else an untold place along an axis would leave nothing told across it.
    """
    whole = _with_offsets_within(found, CLAIMED)
    if found.shown_spurious_share < SPURIOUS:
        return whole
    # By a factor, as rounding of large products would leave the difference of two such terms indefinite.
    products = _products(found, _with_offsets_within(found, 1.0).of_offsets)
    whole = whole.grown(_of_solution(found) @ factor_of(products))
    return whole.grown(_beside_lines(found, whole.of_offsets))


def _of_solution(found: PivotSolution) -> FloatArray:
    """The covariance (3 k + p, 3 k + p) of offsets and x by Gauss and Newton, in the weights' units."""
    solution, crossed = found.solution, found.solution.offset_path
    return np.block([[solution.offset_covariance, crossed], [crossed.T, solution.covariance]])


def _with_offsets_within(found: PivotSolution, times: float) -> JointCovariance:
    """The joint covariance without spurious information, of offsets with a prior so many times as wide as what holds
    them, and without products of errors.

    Directions without any information get a standard deviation of the path's greatest distance.
    """
    variance, solution = found.variance, found.solution
    distance = float(np.linalg.norm(found.sampled.position(solution.x), axis=1).max())
    crossed, joint = solution.offset_path, _of_solution(found)
    likeliest = solution if found.shown_spurious_share < SPURIOUS else found.at_likeliest  # which takes time
    own, prior = likeliest.offset_covariance, _prior(found, times)
    columns = np.concatenate(
        spurious_information_columns(own, likeliest.offset_path, found.shown_spurious, _least(found), prior),
        axis=0,
    )
    unseen = np.concatenate([solution.offset_null_space, solution.null_space])
    unseen = unseen * (distance / np.maximum(found.sampled.lengths(solution.null_space), 1e-300))
    points = [body.points - lost * body.points for body, lost in zip(found.bodies, found.lost, strict=True)]
    far = implausible_columns(points, solution.offset_covariance, crossed)
    feigned = feigned_columns(points, solution.offset_covariance, crossed, found.shown_spurious)
    whole = JointCovariance(variance * (joint + columns @ columns.T) + unseen @ unseen.T, len(found.bodies))
    whole = whole.grown(np.concatenate(far, axis=0)).grown(np.concatenate(feigned, axis=0))
    if all(body.in_line for body in found.bodies):
        whole = whole.grown(without_spurious_path(found, _least(found)))
    return whole


def _beside_lines(found: PivotSolution, offsets: FloatArray) -> FloatArray:
    """Columns (3 k + p, d) that leave nothing told by features nearly in a line, where their offset is not observable,
    or noise alone may make the width that they have.

    Attitudes about the line are off by more than they claim, as it has hardly any width. A centre of mass beside it may
    then be found on it, where nothing depends on these. offsets (k, 3, 3): the covariances of offsets.
    """
    columns = []
    for index, (body, covariance) in enumerate(zip(found.bodies, offsets, strict=True)):
        told = np.linalg.eigvalsh(covariance)[-1] <= (UNOBSERVABLE * rms_radius(body.points)) ** 2
        told &= rms_width(body.points) > WIDE * found.noise
        if are_in_line(body.points, LINE) and not (body.in_line or told):
            column = np.zeros((3 * len(found.bodies), 3))
            column[3 * index : 3 * index + 3] = np.eye(3)
            columns.append(farthest(body.points, AT_ONE_END) * block_diag(column, _displacement(found.sampled.itself)))
    size = 3 * len(found.bodies) + len(found.solution.x)
    return np.concatenate([np.zeros((size, 0)), *columns], axis=1)


def _displacement(path: SampledPath) -> FloatArray:
    """The changes of x (p, 3) that displace a path by 1 m along each axis, as nearly as it can be."""
    axes = np.broadcast_to(np.eye(3), (path.frames, 3, 3))
    mean = path.moment(slice(0, path.frames), axes) / path.frames
    return np.asarray(np.linalg.pinv(path.mean_square(), hermitian=True) @ mean)


def is_at_rest(found: PivotSolution) -> bool:
    """Whether the last step is small to the covariance without spurious information; the weights must have settled.

    Where nothing tells the centre of mass, steps follow the noise of the attitudes, slowly and far, but within it.
    """
    last, offset = found.last, found.solution.offset_covariance
    untold = untold_decrease(last.offsets, offset, found.shown_spurious, _least(found), _prior(found, 1.0))
    return last.steady and last.decrease - untold <= STEP_TOLERANCE * found.residual_variance


def _products(found: PivotSolution, offsets: FloatArray) -> FloatArray:
    """The variance (3 k + p, 3 k + p) of the cost's gradient from products of errors, for the offsets' covariances.

    Errors of the attitudes last as long as those of the features that make them.
    """
    k, size = 3 * len(found.bodies), len(found.solution.x)
    total = np.zeros((k + size, k + size))
    for index, (noisy, offset) in enumerate(zip(found.noisy_attitudes, offsets, strict=True)):
        own = np.r_[3 * index : 3 * index + 3, k : k + size]
        total[np.ix_(own, own)] += found.lasting * noisy.product_gradient(found.sampled, offset)
    return total


def _least(found: PivotSolution) -> float:
    """The least information on an offset, in the weights' units."""
    bodies = [body for body, lost in zip(found.bodies, found.lost, strict=True) if not lost] or found.bodies
    return found.variance / max(farthest(body.points, AT_ONE_END) for body in bodies) ** 2


def _prior(found: PivotSolution, times: float) -> OffsetPrior:
    """The prior of the bodies' offsets, in the weights' units, so many times as wide as what holds them, or as is
    likeliest where they contradict that.

    Of an offset that is told, it is next to nothing. Where hardly anything tells one, its width is all that is claimed,
    and that by which offsets are held is that of most objects: the few features that are seen of some are at one end.
    """
    known = block_diag(*found.offset_prior_information)
    offsets = np.concatenate([body.points.mean(axis=0) for body in found.bodies])
    held = float(np.sum(known * found.solution.offset_covariance))  # how many coordinates the prior tells
    wider = float(offsets @ known @ offsets) / found.variance / max(held, 1.0)
    return OffsetPrior(known / max(wider, times**2), block_diag(*found.offset_information))
