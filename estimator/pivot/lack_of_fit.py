"""What may be wrong with a path that fits: a departure from its kind, and directions seen by noise alone."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2

from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.spurious import spurious_information_columns, three_sigma_factor
from baryscope.estimator.dynamics.paths import Polynomial, SampledPath
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import symmetric_inverses, symmetric_pseudo_inverse
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.pivot.refinement import FEW_FRAMES, Pivot, thinned
from baryscope.estimator.registration.body import Body
from baryscope.estimator.result import LackOfFit

FloatArray = NDArray[np.float64]

FOREIGN = 0.01  # of a cubic's size that a path must be unable to follow, to be a departure from it
CHANCE = 1e-7  # of a departure that is none
TEST_FRAMES = 1500  # frames at most that a departure from the path is looked for in


def lack_of_fit(found: Pivot, time: FloatArray) -> LackOfFit | None:
    """A finding if the CoM departs from its kind of path by more than noise explains: by a cubic in time, added to it.

    Only what the path itself cannot do is added. Where there is no departure, the gain in cost of these k unknowns is
    χ² distributed with k degrees of freedom; where a direction is hardly seen noise may gain more: nothing is said.
    """
    thin = thinned(found.bodies, found.observations, TEST_FRAMES)
    few, rows, x = thin.observations, thin.rows, found.solution.x
    own = found.sampled.jacobian[rows]
    cubic = Polynomial(3, float(time[0]), float(time[-1])).at(time[rows]).jacobian
    known, added = own.reshape(3 * len(rows), -1), cubic.reshape(3 * len(rows), -1)
    added = added - known @ (symmetric_pseudo_inverse(known.T @ known) @ (known.T @ added))
    squares, axes = np.linalg.eigh(added.T @ added)
    size = np.linalg.norm(cubic, axis=(0, 1)).max()
    new = added @ axes[:, squares > (FOREIGN * size) ** 2] / size
    if not new.shape[1]:
        return None
    position, new = found.sampled.position(x)[rows], np.sqrt(len(rows)) * new.reshape(len(rows), 3, -1)
    wider = SampledPath(np.concatenate([own, new], axis=2), lambda y: position + new @ y[len(x) :])
    start = np.concatenate([x, np.zeros(new.shape[2])])
    freed, held = (
        gauss_newton_step(thin.bodies, few, wider, start),
        gauss_newton_step(thin.bodies, few, SampledPath(own, lambda _: position), x),
    )
    gain = (freed.step - held.step) / found.variance
    if chi2.sf(gain, new.shape[2]) > CHANCE or _is_faint(found):
        return None
    metres = float(wider.lengths((freed.x - start)[:, None])[0])
    return LackOfFit(found.path.name, metres, float(gain), int(new.shape[2]))


def _is_faint(found: Pivot) -> bool:
    """Whether the CoM is hardly seen in some direction in which a body's offset lies."""
    widened = without_spurious_information(found, found.sampled.position(found.solution.x))[1]
    before = found.variance * _diagonal_blocks(found.solution.offset_covariance)
    return bool(np.any(np.trace(widened, axis1=1, axis2=2) > 1.5 * np.trace(before, axis1=1, axis2=2)))


def without_spurious_information(found: Pivot, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The covariances of x (p, p) and of each body's offset (k, 3, 3), without what only attitude noise made visible.

    A point on the axis of a pure spin does not move, but with noisy attitudes it seems to: by Σ (tr C − C), C a frame's
    covariance of attitude. Where a direction is seen hardly better than that, it is not seen.
    """
    variance, solution = found.variance, found.solution
    reach = float(np.linalg.norm(origin, axis=1).max())
    # All bodies at once: what one seems to see of the path the others would take for known.
    spurious = block_diag(
        *(
            three_sigma_factor(len(body.frames)) * _spurious_information(body, found.observations, origin, variance)
            for body in found.bodies
        )
    )
    missing, gain = spurious_information_columns(
        solution.offset_covariance, solution.offset_path, spurious, variance / reach**2
    )
    # What is not seen at all may be anywhere within reach.
    spread = reach / np.maximum(found.sampled.lengths(solution.null_space), 1e-300)
    covariance = (
        variance * (solution.covariance + gain @ gain.T) + (solution.null_space * spread**2) @ solution.null_space.T
    )
    offsets = variance * (solution.offset_covariance + missing @ missing.T)
    offsets += (solution.offset_null_space * spread**2) @ solution.offset_null_space.T
    return covariance, _diagonal_blocks(offsets)


def _diagonal_blocks(matrix: FloatArray) -> FloatArray:
    """Of a matrix (3 k, 3 k), (k, 3, 3)."""
    k = len(matrix) // 3
    return np.asarray(matrix.reshape(k, 3, k, 3)[np.arange(k), :, np.arange(k)])


def _spurious_information(body: Body, observations: Observations, origin: FloatArray, variance: float) -> FloatArray:
    """What the noise of a body's attitudes seems to tell of its offset, (3, 3) in S, in the weights' units.

    A frame whose attitude is off by φ sees the offset d moved by φ × d. With C the covariance of φ and Q what the frame
    says of its position when its attitude is not known, that seems to be the information Σ tr([eᵢ]×ᵀ Q [eⱼ]× C).
    """
    every = max(1, len(body.frames) // FEW_FRAMES)
    frames, attitude = body.frames[::every], body.attitude[::every]
    found = pieces(observations.frames(frames).features(body.features), attitude, origin[frames], body.points)
    inverse = symmetric_inverses(found.turn)
    known = found.shift - np.swapaxes(found.turn_shift, 1, 2) @ inverse @ found.turn_shift
    axes = cross_matrices(np.eye(3))
    return np.asarray(variance * every * np.einsum("iba,kbc,jcd,kda->ij", axes, known, axes, inverse, optimize=True))
