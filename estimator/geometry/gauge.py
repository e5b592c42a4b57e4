"""Gauge freedom of body axes: derivatives of axes that are attached to the body's points.

The axes of a rigid cluster are arbitrary up to a rotation. This gauge freedom is fixed by attaching the axes to the
points: if the points are changed, the axes turn with them. Points in a line tell no rotation about it: there the axes
are attached to the line and the origin, which stay in one plane.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]

IN_LINE = 0.03  # rms distance from a line over that along it, up to which points are in a line


def are_in_line(points: FloatArray, most: float = IN_LINE) -> bool:
    """Whether points (m, 3) are in a line; up to IN_LINE, their axes are those of the line and the origin.

    most: rms distance from a line over that along it.
    """
    values = np.linalg.eigvalsh(_inertia(points))
    return bool(values[0] <= most**2 * values[-1])


def offset_by_points(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m) of the centroid of points (m, 3) by the points, in axes attached to the points.

    A rotation of all points about their centroid rotates the axes, so the centroid rotates in them.
    """
    centroid = points.mean(axis=0)
    mean = np.tile(np.eye(3), len(points)) / len(points)
    found = mean + cross_matrices(centroid[None])[0] @ turn_by_points(points)
    if are_in_line(points):
        across = np.cross(np.linalg.eigh(_inertia(points))[1][:, 0], centroid)
        found = found - np.outer(across, across @ found) / max(float(across @ across), 1e-300)
    return np.asarray(found)


def turn_by_points(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m), rad/m, of the rotation of axes attached to points (m, 3), but for one about a line.

    The rotation is the least-squares rotation of the points about their centroid.
    """
    arms = cross_matrices(points - points.mean(axis=0))
    inverse = np.linalg.pinv(_inertia(points), rcond=IN_LINE**2, hermitian=True)
    return np.asarray(inverse @ arms.transpose(1, 0, 2).reshape(3, -1))


def _inertia(points: FloatArray) -> FloatArray:
    """That (3, 3) of points (m, 3) of mass 1 about their centroid, m²."""
    arms = cross_matrices(points - points.mean(axis=0))
    return np.asarray(np.einsum("mij,mkj->ik", arms, arms))
