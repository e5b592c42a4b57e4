"""Tests of a fitted path: lack of fit of its model, and spurious information from the noise of the attitudes."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from baryscope.estimator.adjustment.attitude_noise import excess_noise
from baryscope.estimator.adjustment.spurious import (
    farthest,
    implausible_columns,
    spurious_information_columns,
    untold_decrease,
)
from baryscope.estimator.dynamics.paths import Polynomial, SampledPath
from baryscope.estimator.findings import LackOfFit
from baryscope.estimator.geometry.symmetric import factor_of, symmetric_pseudo_inverse
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.pivot.refinement import STEP_TOLERANCE, Pivot, subsampled

FloatArray = NDArray[np.float64]

MIN_NEW_SHARE = 0.01  # share of a cubic that the path model cannot represent, from which it is tested
SIGNIFICANCE = 1e-7  # probability of a lack of fit by chance
TEST_FRAMES = 1500  # frames used in the test, at most
SPURIOUS = 0.02  # share of the information on an offset that is spurious, from which the attitudes are looked at
MAX_SPURIOUS_GROWTH = 1.5  # of an offset's variance by removal of spurious information, for the test to be valid


def lack_of_fit(found: Pivot, time: FloatArray) -> LackOfFit | None:
    """A finding if a cubic in time, added to the path model, improves the fit by more than noise explains.

    Only the part of the cubic that the path model cannot represent is added, with k unknowns. If the model is right,
    the decrease of the cost is χ² distributed with k degrees of freedom. This does not hold if a direction is poorly
    observed, so there is no finding then.
    """
    subsample = subsampled(found.bodies, found.observations, TEST_FRAMES)
    few, rows, x = subsample.observations, subsample.rows, found.solution.x
    own = found.sampled.jacobian[rows]
    cubic = Polynomial(3, float(time[0]), float(time[-1])).at(time[rows]).jacobian
    known, added = own.reshape(3 * len(rows), -1), cubic.reshape(3 * len(rows), -1)
    added = added - known @ (symmetric_pseudo_inverse(known.T @ known) @ (known.T @ added))
    squares, axes = np.linalg.eigh(added.T @ added)
    size = np.linalg.norm(cubic, axis=(0, 1)).max()
    new = added @ axes[:, squares > (MIN_NEW_SHARE * size) ** 2] / size
    if not new.shape[1]:
        return None
    position, new = found.sampled.position(x)[rows], np.sqrt(len(rows)) * new.reshape(len(rows), 3, -1)
    extended = SampledPath(np.concatenate([own, new], axis=2), lambda y: position + new @ y[len(x) :])
    start = np.concatenate([x, np.zeros(new.shape[2])])
    shift = None if found.shift is None else found.shift[rows]
    with_cubic, without = (
        gauss_newton_step(subsample.bodies, few, extended, start, shift),
        gauss_newton_step(subsample.bodies, few, SampledPath(own, lambda _: position), x, shift),
    )
    gain = (with_cubic.step - without.step) / found.variance
    if chi2.sf(gain, new.shape[2]) > SIGNIFICANCE or _is_poorly_observed(found):
        return None
    metres = float(extended.lengths((with_cubic.x - start)[:, None])[0])
    return LackOfFit(found.path.name, metres, float(gain), int(new.shape[2]))


def _is_poorly_observed(found: Pivot) -> bool:
    """Whether spurious information is a large part of the information on some body's offset."""
    corrected = without_spurious_information(found)[1]
    before = found.variance * _diagonal_blocks(found.solution.offset_covariance)
    growth = np.trace(corrected, axis1=1, axis2=2), MAX_SPURIOUS_GROWTH * np.trace(before, axis1=1, axis2=2)
    return bool(np.any(growth[0] > growth[1]))


def without_spurious_information(found: Pivot) -> tuple[FloatArray, FloatArray]:
    """The covariances of x (p, p) and of each body's offset (k, 3, 3) in m², without spurious information.

    The position along the axis of a pure spin is not observable, but the noise of the attitudes adds apparent
    information Σ (tr C − C), C a frame's covariance of attitude. It is subtracted, with a margin of three standard
    deviations; what remains is that of `farthest`. Where it matters, products of errors are counted, too. Directions
    without any information get a standard deviation of the path's greatest distance.
    """
    variance, solution = found.variance, found.solution
    distance = float(np.linalg.norm(found.sampled.position(solution.x), axis=1).max())
    crossed = solution.offset_path
    joint = np.block([[solution.offset_covariance, crossed], [crossed.T, solution.covariance]])
    least = variance / max(farthest(body.points) for body in found.bodies) ** 2
    columns = np.concatenate(
        spurious_information_columns(solution.offset_covariance, crossed, _spurious(found), least), axis=0
    )
    unseen = np.concatenate([solution.offset_null_space, solution.null_space])
    unseen = unseen * (distance / np.maximum(found.sampled.lengths(solution.null_space), 1e-300))
    covariance = variance * (joint + columns @ columns.T) + unseen @ unseen.T
    far = implausible_columns([body.points for body in found.bodies], solution.offset_covariance, crossed)
    lengths = np.concatenate(far, axis=0)
    covariance += lengths @ lengths.T
    k = len(solution.offset_covariance)
    if found.spurious_share >= SPURIOUS:
        # By a factor, as rounding of large products would leave the difference of two such terms indefinite.
        root = joint @ factor_of(_products(found, _diagonal_blocks(covariance[:k, :k])))
        covariance += root @ root.T
    return covariance[k:, k:], _diagonal_blocks(covariance[:k, :k])


def is_at_rest(found: Pivot) -> bool:
    """Whether the last step is small to the covariance without spurious information; the weights must have settled.

    Where nothing tells the centre of mass, steps follow the noise of the attitudes, slowly and far, but within it.
    """
    last, offset = found.last, found.solution.offset_covariance
    least = found.variance / max(farthest(body.points) for body in found.bodies) ** 2
    untold = untold_decrease(last.offsets, offset, _spurious(found), least)
    return last.steady and last.decrease - untold <= STEP_TOLERANCE * found.residual_variance


def _products(found: Pivot, offsets: FloatArray) -> FloatArray:
    """The variance (3 k + p, 3 k + p) of the cost's gradient from products of errors, for the offsets' covariances.

    Errors of the attitudes last as long as those of the features that make them.
    """
    k, size = 3 * len(found.bodies), len(found.solution.x)
    total = np.zeros((k + size, k + size))
    for index, (noisy, offset) in enumerate(zip(found.noisy_attitudes, offsets, strict=True)):
        own = np.r_[3 * index : 3 * index + 3, k : k + size]
        total[np.ix_(own, own)] += found.lasting * noisy.product_gradient(found.sampled, offset)
    return total


def _spurious(found: Pivot) -> FloatArray:
    """The spurious information (3 k, 3 k) on the bodies' offsets; where it matters, as their attitudes show it.

    Jointly for all bodies: spurious information of one body on the path would propagate to the others.
    """
    spurious = found.spurious
    if found.spurious_share >= SPURIOUS:
        shown = (excess_noise(body, found.observations, found.frame_variance) for body in found.bodies)
        spurious = tuple(excess * own for excess, own in zip(shown, spurious, strict=True))
    return np.asarray(block_diag(*spurious))


def _diagonal_blocks(matrix: FloatArray) -> FloatArray:
    """The diagonal blocks (k, 3, 3) of a matrix (3 k, 3 k)."""
    k = len(matrix) // 3
    return np.asarray(matrix.reshape(k, 3, k, 3)[np.arange(k), :, np.arange(k)])
