"""Rotations in SO(3): cross-product matrices, and the exponential map with its inverse."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import matrix_from_quaternion, quaternion_from_matrix

FloatArray = NDArray[np.float64]


def exp_rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad."""
    across = vector.reshape(-1, 3).T
    half = 0.5 * np.linalg.norm(across, axis=0)
    # sin(a)/a without a division by zero
    quaternion = np.concatenate([np.cos(half)[None], 0.5 * np.sinc(half / np.pi) * across])
    return matrix_from_quaternion(quaternion.T).reshape(*vector.shape, 3)


def log_rotation(matrix: FloatArray) -> FloatArray:
    """Rotation vectors (n, 3) in rad of rotation matrices (n, 3, 3), of angles up to π."""
    q = quaternion_from_matrix(matrix)
    q = np.where(q[:, :1] < 0, -q, q)
    sine = np.linalg.norm(q[:, 1:], axis=1)
    angle = 2 * np.arctan2(sine, q[:, 0])
    return np.asarray(np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)[:, None] * q[:, 1:])


def turned_information(information: FloatArray, turn: FloatArray) -> FloatArray:
    """Σ tr([eᵢ]×ᵀ Q [eⱼ]× C) (3, 3): the mean information on d of observations Q (n, 3, 3) of φ × d, with random φ.

    turn C (n, 3, 3): the covariance of φ, a rotation vector in rad, of mean zero.
    """
    # Σ Q ⊗ C first, over all frames in one multiplication.
    both = (information.reshape(-1, 9).T @ turn.reshape(-1, 9)).reshape(3, 3, 3, 3)
    turned = np.tensordot(_AXES, both, axes=((1, 2), (0, 3)))  # (i, c, d)
    return np.asarray(np.tensordot(turned, _AXES, axes=((1, 2), (1, 2))))


def squared_cross(turn: FloatArray) -> FloatArray:
    """E [φ]×ᵀ [φ]× = tr C 1 − C, (3, 3), for a rotation vector φ of the covariance C (3, 3), rad²."""
    return np.asarray(np.trace(turn) * np.eye(3) - turn)


def cross_matrices(vectors: FloatArray) -> FloatArray:
    """[v]× (m, 3, 3) of vectors (m, 3)."""
    matrix = np.zeros((len(vectors), 3, 3))
    matrix[:, 2, 1], matrix[:, 0, 2], matrix[:, 1, 0] = vectors.T
    matrix[:, 1, 2], matrix[:, 2, 0], matrix[:, 0, 1] = -vectors.T
    return matrix


_AXES = cross_matrices(np.eye(3))
