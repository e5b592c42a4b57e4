"""Generalised Procrustes: one shape for all frames of an interval, and its pose in each of them.

Equations (9)–(12) of Biondi, Mauro, Pastorelli (2017), with their errors corrected: both point clouds are centred, the
rotation is kept in SO(3), and the rigid points are R_C_S X̄ + c. Two references for the poses:

- "mean" (Gower, Psychometrika 40, 1975): the current mean shape; repeated until the shape converges;
- "first" (the paper): the first frame's points, once; the shape is the mean of the registered frames.

S are the shape's axes: parallel to the tracks' axes in the interval's first frame, origin at the shape's centroid.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS, matrix_from_quaternion, rotation_from_moments
from baryscope.estimator.options import Reference

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

TOLERANCE = 1e-11  # greatest change of a converged shape in one iteration, relative to its size
MAX_ROUNDS = 100  # of poses and the shape by turns
ADEQUATE = 0.1  # change in the last iteration, over the noise of a point's mean, of a shape that is good enough
OFF_LINE = 3.0  # root of the summed squared distances from a line over a coordinate's noise, for a valid attitude


@dataclass(frozen=True)
class Registration:
    """The rigid motion of one cluster over n frames: p_C = R_C_S p_S + translation.

    shape (m, 3) p_S in m, NaN for features that are never seen; rotation (n, 3, 3) R_C_S; translation (n, 3) in m, the
    shape's centroid in C; valid (n,), False where fewer than three or collinear points leave the pose undetermined;
    moment (n,), m²: a lower bound of the sum of squared distances of a frame's points from a line;
    rms in m, the residual's standard deviation per coordinate; radius in m, the shape's rms radius; rounds, the number
    of iterations; converged: whether the last one changed the shape by less than a tenth of
    what noise does.
    """

    shape: FloatArray
    rotation: FloatArray
    translation: FloatArray
    valid: BoolArray
    moment: FloatArray
    rms: float
    radius: float
    rounds: int
    converged: bool

    @property
    def rigid_points(self) -> FloatArray:
        """The shape at each frame's pose, (n, m, 3) in m: equation (12), corrected."""
        return np.asarray(self.shape @ np.swapaxes(self.rotation, 1, 2) + self.translation[:, None])

    @property
    def angle_deviation(self) -> float:
        """Standard deviation of a pose's rotation about an axis in rad: σ √(1.5/(nρ²)); infinite for a single point.

        The difference of two independent poses has √2 of this, σ √(3/(nρ²)), see docs/theory/registration.md.
        """
        if self.radius == 0:
            return np.inf
        count = np.isfinite(self.shape[:, 0]).sum()
        return float(self.rms * np.sqrt(1.5 / count) / self.radius)


def register(points: FloatArray, reference: Reference = "mean", tolerance: float = TOLERANCE) -> Registration:
    """Register the frames of one interval; points (n, m, 3) in m with NaN where a feature is not seen.

    The first frame must see at least three features, and every other frame three of these, as in the intervals of
    `find_intervals`. Features that first appear later are merged into the shape. The mean shape has converged when an
    iteration changes it by no more than `tolerance`, relative to its size.
    """
    seen = ~np.isnan(points[..., 0])
    weights = seen.astype(np.float64)
    # Everything below is sums over features or frames; with coordinates before features they are matrix products.
    cloud = np.ascontiguousarray(np.swapaxes(np.where(seen[..., None], points, 0.0), 1, 2))  # (n, 3, m)
    in_shape = seen[0].copy()
    shape = np.where(in_shape[:, None], cloud[0].T, 0.0)
    shape -= in_shape[:, None] * shape[in_shape].mean(axis=0)
    size = _radius(shape[in_shape])
    converged, rounds = False, 0
    while not converged and rounds < MAX_ROUNDS:
        rounds += 1
        rotation, translation, _ = _poses(cloud, weights, shape, in_shape)
        update, placed = _mean_shape(cloud, weights, rotation, translation)
        change = np.abs(update - shape)[in_shape].max() if (placed == in_shape).all() else np.inf
        shape, in_shape = update, placed
        converged = reference == "first" or bool(change <= tolerance * size)
    if reference == "mean":
        rotation, translation, spread = _poses(cloud, weights, shape, in_shape)
    else:
        # The paper keeps the rotations to the first frame; only the centroids follow the mean shape.
        _, _, spread = _poses(cloud, weights, shape, in_shape)
        translation = _translations(cloud, weights, shape, rotation)
    # Make the shape's axes parallel to the tracks' axes in the first frame, and move its origin to its centroid.
    R_S_old = rotation[0]
    shape = np.where(in_shape[:, None], shape @ R_S_old.T, np.nan)
    rotation = rotation @ R_S_old.T
    centre = np.nanmean(shape, axis=0)
    shape = shape - centre
    translation = translation + rotation @ centre
    rms = _residual(cloud, weights, np.nan_to_num(shape), rotation, translation)
    radius = _radius(shape[in_shape])
    valid = (seen.sum(axis=1) >= FEWEST_POINTS) & (spread > (OFF_LINE * rms) ** 2) & (spread > (1e-9 * radius) ** 2)
    adequate = converged or bool(change <= ADEQUATE * rms / np.sqrt(len(points)))
    moment = spread * seen[:, in_shape].sum(axis=1)
    return Registration(
        shape=shape,
        rotation=rotation,
        translation=translation,
        valid=valid,
        moment=moment,
        rms=rms,
        radius=radius,
        rounds=rounds,
        converged=adequate,
    )


def _poses(
    cloud: FloatArray, weights: FloatArray, shape: FloatArray, in_shape: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rotations R_C_S (n, 3, 3), translations (n, 3) in m, and spread (n,) in m², of the frames against the shape."""
    n, _, m = cloud.shape
    used = weights * in_shape
    total = np.maximum(used.sum(axis=1), 1.0)
    centroid = np.einsum("nim,nm->ni", cloud, used) / total[:, None]
    centred = (cloud - centroid[:, :, None]) * used[:, None, :]
    # The shape need not be centred on the visible points: Σ (p − c) x̄ᵀ is zero for any x̄.
    moments = (centred.reshape(3 * n, m) @ shape).reshape(n, 3, 3)
    quaternion, spread = rotation_from_moments(moments)
    rotation = matrix_from_quaternion(quaternion)
    translation = centroid - np.einsum("nij,nj->ni", rotation, (used @ shape) / total[:, None])
    return rotation, translation, spread / total


def _translations(cloud: FloatArray, weights: FloatArray, shape: FloatArray, rotation: FloatArray) -> FloatArray:
    total = np.maximum(weights.sum(axis=1), 1.0)[:, None]
    centroid = np.einsum("nim,nm->ni", cloud, weights) / total
    return np.asarray(centroid - np.einsum("nij,nj->ni", rotation, (weights @ shape) / total))


def _mean_shape(
    cloud: FloatArray, weights: FloatArray, rotation: FloatArray, translation: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """The mean over frames of R_S_C (p − translation) for each feature, (m, 3), and which features are seen, (m,)."""
    n, _, m = cloud.shape
    moved = (cloud - translation[:, :, None]) * weights[:, None, :]
    total = weights.sum(axis=0)
    shape = (rotation.reshape(3 * n, 3).T @ moved.reshape(3 * n, m)).T / np.maximum(total, 1.0)[:, None]
    placed = total > 0
    return shape - placed[:, None] * shape[placed].mean(axis=0), placed


def _residual(
    cloud: FloatArray, weights: FloatArray, shape: FloatArray, rotation: FloatArray, translation: FloatArray
) -> float:
    """Standard deviation per coordinate of the residuals, with the degrees of freedom counted."""
    residual = (cloud - rotation @ shape.T - translation[:, :, None]) * weights[:, None, :]
    dof = 3 * weights.sum() - 6 * len(cloud) - 3 * (weights.sum(axis=0) > 0).sum() + 6
    return float(np.sqrt(np.vdot(residual, residual) / max(dof, 1.0)))


def _radius(shape: FloatArray) -> float:
    return float(np.sqrt(((shape - shape.mean(axis=0)) ** 2).sum() / len(shape)))
