"""Joint normal equations of a tumbling body whose centre of mass moves on a path, observed by its features.

The unknowns y are rate and inertia at the epoch (8) and the path's x. The attitude at the epoch defines the body's axes
and is no unknown. The model is linear in the points b, which are eliminated (variable projection). The inverse of these
normal equations is the Cramér–Rao bound at the true values, and the covariance at the estimate, without a prior.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, Pieces, pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.paths import SampledPath
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, Attitudes
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.symmetric import null_space_of, symmetric_pseudo_inverse

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations after the elimination of the points, for weights that are inverse variances.

    matrix (q, q) and rhs (q,) of y = (rate and inertia, x); sizes (q,): the matrix's diagonal before the elimination;
    points (m, 3) in B, m: the optimal ones for this motion and path; squares (n, m): weighted squared residuals with
    these points; point_inverse (m, 3, 3): covariance of the points conditional on y; by_unknowns (3 m, q): a change δy
    changes the points by −by_unknowns δy.
    """

    matrix: FloatArray
    sizes: FloatArray
    rhs: FloatArray
    points: FloatArray
    squares: FloatArray
    point_inverse: FloatArray
    by_unknowns: FloatArray

    @property
    def cost(self) -> float:
        """The weighted sum of squared residuals."""
        return float(self.squares.sum())

    def covariance(self, path: SampledPath, distance: float, prior: FloatArray | float = 0.0) -> FloatArray:
        """The covariance (q, q) of y.

        distance: the rms displacement of the path, m, for one standard deviation along an unobserved direction;
        prior: information on y to add.
        """
        matrix = self.matrix + prior
        null_space = null_space_of(matrix, self.sizes)
        lengths = path.lengths(null_space[RATE_AND_INERTIA:])
        typical = path.lengths(np.diag(1 / np.sqrt(self.sizes[RATE_AND_INERTIA:]))).max()
        moving = lengths > 1e-6 * typical  # the others change rate and inertia only
        spread = np.where(moving, distance / np.where(moving, lengths, 1.0), 0.0)
        return np.asarray(symmetric_pseudo_inverse(matrix, self.sizes) + (null_space * spread**2) @ null_space.T)

    def offset_covariance(self, covariance: FloatArray, features: IntArray) -> tuple[FloatArray, FloatArray]:
        """Covariance (3, 3) of the offset of some features, and its cross-covariance (3, q) with y.

        The offset is that of the features' centroid from the centre of mass, in axes attached to them; covariance
        (q, q) is that of y.
        """
        attached = offset_by_points(self.points[features])
        by_y = attached @ self.by_unknowns.reshape(len(self.points), 3, -1)[features].reshape(3 * len(features), -1)
        own = attached.reshape(3, -1, 3).transpose(1, 0, 2)
        alone = (own @ self.point_inverse[features] @ own.transpose(0, 2, 1)).sum(axis=0)
        return np.asarray(alone + by_y @ covariance @ by_y.T), np.asarray(-by_y @ covariance)


def equations(
    observations: Observations, motion: Attitudes, path: SampledPath, origin: FloatArray, points: FloatArray
) -> Equations:
    """The normal equations at a motion and a path with positions `origin` (n, 3) in C, linearised at points (m, 3)."""
    n, m = observations.weight.shape
    q = RATE_AND_INERTIA + path.jacobian.shape[2]
    matrix, rhs, coupling = np.zeros((q, q)), np.zeros(q), np.zeros((q, 3 * m))
    point, point_rhs = np.zeros((m, 3, 3)), np.zeros((m, 3))
    for part in _chunks(n, m, observations.precision is not None):
        found, turn, shift = _pieces_of(part, observations, motion, path, origin, points)
        moves = np.concatenate([turn, shift], axis=1)
        blocks = np.concatenate(
            [
                np.concatenate([found.turn, found.turn_shift], axis=2),
                np.concatenate([np.swapaxes(found.turn_shift, 1, 2), found.shift], axis=2),
            ],
            axis=1,
        )
        flat = moves.reshape(-1, q)
        matrix += flat.T @ (blocks @ moves).reshape(-1, q)
        rhs += flat.T @ np.concatenate([found.turn_rhs, found.shift_rhs], axis=1).ravel()
        coupling += found.unknowns_points(turn, shift)
        point += found.point
        point_rhs += found.point_rhs
    seen = np.trace(point, axis1=1, axis2=2) > 0
    inverse = np.zeros_like(point)
    inverse[seen] = np.linalg.inv(point[seen])
    by_unknowns = np.einsum("mij,qmj->miq", inverse, coupling.reshape(q, m, 3)).reshape(3 * m, q)
    change = np.einsum("mij,mj->mi", inverse, point_rhs)
    best = points + change
    sizes = np.diag(matrix).copy()
    matrix -= coupling @ by_unknowns
    rhs -= coupling @ change.ravel()
    squares = np.empty((n, m))
    for part in _chunks(n, m, observations.precision is not None):
        attitude = motion.attitude[part]
        residual = observations.position[part] - origin[part][:, None] - best @ np.swapaxes(attitude, 1, 2)
        squares[part] = observations.weight[part] * observations.frames(part).squares(residual)
    return Equations(matrix, sizes, rhs, best, squares, inverse, by_unknowns)


def _pieces_of(
    part: slice,
    observations: Observations,
    motion: Attitudes,
    path: SampledPath,
    origin: FloatArray,
    points: FloatArray,
) -> tuple[Pieces, FloatArray, FloatArray]:
    """The blocks of some frames, and the Jacobians (n, 3, q) of their rotations φ and shifts τ by y."""
    attitude = motion.attitude[part]
    found = pieces(observations.frames(part), attitude, origin[part], points)
    own, p = motion.turn[part], path.jacobian.shape[2]
    turn = np.concatenate([own, np.zeros((len(own), 3, p))], axis=2)
    shift = np.swapaxes(attitude, 1, 2) @ path.jacobian[part]
    shift = np.concatenate([np.zeros_like(own), shift], axis=2)
    return found, turn, shift


def _chunks(n: int, m: int, full: bool) -> list[slice]:
    size = max(64, CHUNK_SIZE // ((9 if full else 3) * m))
    return [slice(first, first + size) for first in range(0, n, size)]
