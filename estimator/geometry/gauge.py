"""Gauge freedom of body axes: derivatives of axes that are attached to the body's points.

The axes of a rigid cluster are arbitrary up to a rotation. This gauge freedom is fixed by attaching the axes to the
points: if the points are changed, the axes turn with them. Points in a line tell no rotation about it: there the axes
are attached to the line and the origin, which stay in one plane.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]

IN_LINE = 0.03  # rms distance from a line over that along it, up to which points are in a line
UNIT = np.eye(3)
ON_LINE = 1e-6  # distance of the origin from a line over the points' radius, below which it is on it


def are_in_line(points: FloatArray, most: float = IN_LINE) -> bool:
    """Whether points (m, 3) are in a line; up to IN_LINE, their axes are those of the line and the origin.

    most: rms distance from a line over that along it.
    """
    return _are_in_line(np.asarray(np.linalg.eigvalsh(_inertia(points - points.mean(axis=0)))), most)


def offset_by_points(points: FloatArray, used: NDArray[Any] | None = None) -> FloatArray:
    """Jacobian (3, 3 m) of the centroid of points (m, 3) by the points, in axes attached to the points.

    A rotation of all points about their centroid rotates the axes, so the centroid rotates in them. used: an index of
    those whose centroid and axes they are, all unless given.
    """
    some = points if used is None else points[used]
    own = _mean(some) + cross_matrices(some.mean(axis=0)[None])[0] @ attached_turn(some)
    if used is None:
        return np.asarray(own)
    found = np.zeros((3, *points.shape))
    found[:, used] = own.reshape(3, -1, 3)
    return found.reshape(3, -1)


def attached_turn(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m), rad/m, of the rotation of axes attached to points (m, 3), from the origin.

    Where they are in a line, that about it keeps the origin in one plane with it: the nearer it is to the line, the
    more an error of the points turns them.
    """
    centroid = points.mean(axis=0)
    arms = points - centroid
    inertia = _inertia(arms)
    values, axes = np.linalg.eigh(inertia)
    found = _turn(arms, values, axes)
    if not _are_in_line(values, IN_LINE):
        return found
    along = axes[:, 0]
    across = np.cross(along, centroid)
    least = ON_LINE**2 * float(np.trace(inertia)) / len(points)
    by_points = across @ (_mean(points) + cross_matrices(centroid[None])[0] @ found)
    return found + np.outer(along, by_points) / max(float(across @ across), least, 1e-300)


def turn_by_points(points: FloatArray) -> FloatArray:
    """Jacobian (3, 3 m), rad/m, of the rotation of axes attached to points (m, 3), but for one about a line.

    The rotation is the least-squares rotation of the points about their centroid.
    """
    arms = points - points.mean(axis=0)
    return _turn(arms, *np.linalg.eigh(_inertia(arms)))


def _turn(arms: FloatArray, values: FloatArray, axes: FloatArray) -> FloatArray:
    """`turn_by_points` for arms (m, 3) from the centroid, with eigenvalues (3,) and axes (3, 3) of their inertia."""
    told = values > IN_LINE**2 * values[-1]
    inverse = (axes[:, told] / values[told]) @ axes[:, told].T
    return np.asarray(inverse @ cross_matrices(arms).transpose(1, 0, 2).reshape(3, -1))


def _are_in_line(values: FloatArray, most: float) -> bool:
    """See `are_in_line`, by the eigenvalues (3,) of the points' inertia."""
    return bool(values[0] <= most**2 * values[-1])


def _mean(points: FloatArray) -> FloatArray:
    """The Jacobian (3, 3 m) of the centroid by points (m, 3)."""
    return np.tile(UNIT / len(points), len(points))


def _inertia(arms: FloatArray) -> FloatArray:
    """The inertia (3, 3) of points of mass 1 at arms (m, 3) from their centroid, m²."""
    products = arms.T @ arms
    return np.asarray(products.trace() * UNIT - products)
