"""Gauge freedom of body axes: derivatives of axes that are attached to the body's points.

The axes of a rigid cluster are arbitrary up to a rotation. This gauge freedom is fixed by attaching the axes to the
points: if the points are changed, the axes turn with them.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]


def offset_by_points(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m) of the centroid of points (m, 3) by the points, in axes attached to the points.

    A rotation of all points about their centroid rotates the axes, so the centroid rotates in them.
    """
    centroid = points.mean(axis=0)
    mean = np.tile(np.eye(3), len(points)) / len(points)
    return np.asarray(mean + cross_matrices(centroid[None])[0] @ turn_by_points(points))


def turn_by_points(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m), rad/m, of the rotation of axes attached to points (m, 3).

    The rotation is the least-squares rotation of the points about their centroid.
    """
    arms = cross_matrices(points - points.mean(axis=0))
    inertia = np.einsum("mij,mkj->ik", arms, arms)
    return np.asarray(np.linalg.pinv(inertia, hermitian=True) @ arms.transpose(1, 0, 2).reshape(3, -1))
