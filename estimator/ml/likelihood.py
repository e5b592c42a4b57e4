"""Joint normal equations of a tumbling body whose centre of mass moves on a path, observed by its features.

The unknowns y are those of the rotation (rate and inertia at the epoch, modes of a torque) and the path's x. The
attitude at the epoch defines the body's axes and is no unknown. The model is linear in the points b, which are
eliminated (variable projection). The inverse of these normal equations is the Cramér–Rao bound at the true values, and
the covariance at the estimate, without a prior.

A frame may be shifted and turned as a whole, by a camera of noisy attitude or a pivot that slips. With W the weights of
the frame's observations, H their Jacobian by such a movement and C its covariance, the frame's weights become
W − W H (C⁻¹ + Hᵀ W H)⁻¹ Hᵀ W (Woodbury), which couples its points.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.symmetric import inverse_and_null_space
from baryscope.estimator.ml.model import Model
from baryscope.estimator.ml.sums import Sums
from baryscope.estimator.paths.sampled_path import SampledPath

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations after the elimination of the points, for weights that are inverse variances.

    matrix (q, q) and rhs (q,) of y = (rotation, x); rotation_size: how many belong to the rotation; sizes (q,): the
    matrix's diagonal before the elimination; points (m, 3) in B, m: the optimal ones for this motion and path; squares
    (n, m): weighted squared residuals with these points; noise_cost: the squares of the frames' own movements;
    points_covariance (3 m, 3 m): that of the points conditional on y, or (m, 3, 3) if they are independent then;
    by_unknowns (3 m, q): a change δy changes the points by −by_unknowns δy.
    """

    matrix: FloatArray
    rotation_size: int
    sizes: FloatArray
    rhs: FloatArray
    points: FloatArray
    squares: FloatArray
    noise_cost: float
    points_covariance: FloatArray
    by_unknowns: FloatArray

    @property
    def cost(self) -> float:
        """The weighted sum of squared residuals, and of the frames' own movements."""
        return float(self.squares.sum()) + self.noise_cost

    def covariance(self, path: SampledPath, distance: float, prior: FloatArray | float = 0.0) -> FloatArray:
        """The covariance (q, q) of y.

        distance: the rms displacement of the path, m, for one standard deviation along an unobserved direction;
        prior: information on y to add. Where it tells of all unobserved directions, they have its covariance.
        """
        added, own = np.zeros_like(self.matrix) + prior, self.rotation_size
        matrix, sizes = self.matrix + added, self.sizes + np.diag(added)
        known, null_space = inverse_and_null_space(matrix, sizes)
        of_prior, untold = inverse_and_null_space(null_space.T @ added @ null_space)
        if not untold.shape[1]:
            return np.asarray(known + null_space @ of_prior @ null_space.T)
        lengths = path.lengths(null_space[own:])
        typical = path.lengths(np.diag(1 / np.sqrt(sizes[own:]))).max()
        moving = lengths > 1e-6 * typical  # the others change the rotation only
        spread = np.where(moving, distance / np.where(moving, lengths, 1.0), 0.0)
        return np.asarray(known + (null_space * spread**2) @ null_space.T)

    def offset_covariance(self, covariance: FloatArray, features: IntArray) -> tuple[FloatArray, FloatArray]:
        """Covariance (3, 3) of the offset of some features, and its cross-covariance (3, q) with y.

        The offset is that of the features' centroid from the centre of mass, in axes attached to them; covariance
        (q, q) is that of y.
        """
        attached = offset_by_points(self.points[features])
        by_y = attached @ self.by_unknowns.reshape(len(self.points), 3, -1)[features].reshape(3 * len(features), -1)
        alone = attached @ self.covariance_of_points(features) @ attached.T
        return np.asarray(alone + by_y @ covariance @ by_y.T), np.asarray(-by_y @ covariance)

    def covariance_of_points(self, features: IntArray) -> FloatArray:
        """The covariance (3 k, 3 k) of some points (k,) conditional on y."""
        if self.points_covariance.ndim == 3:
            return np.asarray(block_diag(*self.points_covariance[features]))
        columns = (3 * features[:, None] + np.arange(3)).ravel()
        return np.asarray(self.points_covariance[np.ix_(columns, columns)])


def equations(observations: Observations, model: Model) -> Equations:
    """The normal equations at a model."""
    m, q = observations.weight.shape[1], model.size
    sums = Sums.of(observations, model)
    inverse = _points_inverse(sums, model.noise is not None)
    if inverse.ndim == 3:
        by_unknowns = np.einsum("mij,qmj->miq", inverse, sums.coupling.reshape(q, m, 3)).reshape(3 * m, q)
        change = np.einsum("mij,mj->mi", inverse, sums.points_rhs)
    else:
        by_unknowns = inverse @ sums.coupling.T
        change = (inverse @ sums.points_rhs.ravel()).reshape(m, 3)
    sizes = np.diag(sums.matrix).copy()
    best = model.points + change
    squares, noise_cost = _squares(observations, replace(model, points=best))
    return Equations(
        matrix=sums.matrix - sums.coupling @ by_unknowns,
        rotation_size=model.rotation_size,
        sizes=sizes,
        rhs=sums.rhs - sums.coupling @ change.ravel(),
        points=best,
        squares=squares,
        noise_cost=noise_cost,
        points_covariance=inverse,
        by_unknowns=by_unknowns,
    )


def _points_inverse(sums: Sums, dense: bool) -> FloatArray:
    """The points' covariance conditional on y: (3 m, 3 m) if `dense`, else (m, 3, 3); zero for those never seen."""
    seen = np.trace(sums.point, axis1=1, axis2=2) > 0
    inverse = np.zeros_like(sums.point)
    if not dense:
        inverse[seen] = np.linalg.inv(sums.point[seen])
        return inverse
    rows = np.repeat(seen, 3)
    information = block_diag(*sums.point) - sums.subtracted
    found = np.zeros_like(information)
    found[np.ix_(rows, rows)] = np.linalg.inv(information[np.ix_(rows, rows)])
    return np.asarray(found)


def _squares(observations: Observations, model: Model) -> tuple[FloatArray, float]:
    """The weighted squared residuals (n, m), without the frames' own movements, and the cost of these."""
    squares, noise_cost = np.empty(observations.weight.shape), 0.0
    n, m = observations.weight.shape
    for part in _chunks(n, m, observations.precision is not None):
        attitude, own = model.attitude[part], observations.frames(part)
        residual = own.position - model.origin[part][:, None] - model.points @ np.swapaxes(attitude, 1, 2)
        if model.noise is not None:
            found = normal_blocks(own, attitude, model.origin[part], model.points)
            block, rhs = found.of_poses()
            moved = model.noise.frames(part).movements(block, rhs, attitude, model.origin[part])
            residual = residual - model.noise.carried(moved, attitude, model.points)
            # νᵀ C⁻¹ ν is νᵀ (r − B ν).
            noise_cost += float(np.einsum("ki,ki->", moved, rhs - np.einsum("kij,kj->ki", block, moved)))
        squares[part] = own.weight * own.squares(residual)
    return squares, noise_cost


def _chunks(n: int, m: int, full: bool) -> list[slice]:
    size = max(64, CHUNK_SIZE // ((9 if full else 3) * m))
    return [slice(first, first + size) for first in range(0, n, size)]
