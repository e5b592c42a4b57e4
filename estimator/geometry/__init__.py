"""Geometry of points, rotations and symmetric matrices.

Alignment of point sets, SO(3), singular symmetric systems, gauge freedom; nothing depends on tracks, time or noise.
Imports nothing of the estimator's other rooms.
"""

from baryscope.estimator.geometry.alignment import (
    Alignment,
    align,
    matrix_from_quaternion,
    quaternion_from_matrix,
    rotation_from_moments,
)
from baryscope.estimator.geometry.gauge import offset_by_points, turn_by_points
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation, log_rotation
from baryscope.estimator.geometry.symmetric import (
    factor_of,
    is_covariance,
    null_space_of,
    symmetric_inverses,
    symmetric_pseudo_inverse,
)

__all__ = [
    "Alignment",
    "align",
    "cross_matrices",
    "exp_rotation",
    "factor_of",
    "is_covariance",
    "log_rotation",
    "matrix_from_quaternion",
    "null_space_of",
    "offset_by_points",
    "quaternion_from_matrix",
    "rotation_from_moments",
    "symmetric_inverses",
    "symmetric_pseudo_inverse",
    "turn_by_points",
]
