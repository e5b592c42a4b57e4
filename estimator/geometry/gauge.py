"""Axes that points hold themselves: how these turn, and how the centroid moves in them, when the points change.

The axes of a rigid cluster can be turned at will. That gauge freedom is fixed by the points: their axes turn with them.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]


def offset_by_points(points: FloatArray) -> FloatArray:
    """How the centroid of points (m, 3) changes with them in axes that they hold themselves, (3, 3 m).

    A turn of all points about their centroid is a turn of the axes, in which the centroid is then seen turned.
    """
    centroid = points.mean(axis=0)
    mean = np.tile(np.eye(3), len(points)) / len(points)
    return np.asarray(mean + cross_matrices(centroid[None])[0] @ turn_by_points(points))


def turn_by_points(points: FloatArray) -> FloatArray:
    """How the axes that points (m, 3) hold turn with them, (3, 3 m): as the points do about their centroid, at best."""
    arms = cross_matrices(points - points.mean(axis=0))
    inertia = np.einsum("mij,mkj->ik", arms, arms)
    return np.asarray(np.linalg.pinv(inertia, hermitian=True) @ arms.transpose(1, 0, 2).reshape(3, -1))
