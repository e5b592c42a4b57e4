"""Symmetric systems that may be singular: what is seen is solved for, and what is not is named.

Where unknowns have been eliminated, what is left of the diagonal may be rounding alone. So `sizes` is the diagonal that
the matrix had before; without it, the matrix's own.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SEEN = 1e-13  # an eigenvalue below which a direction is not seen, the matrix scaled by its sizes


def symmetric_pseudo_inverse(matrix: FloatArray, sizes: FloatArray | None = None) -> FloatArray:
    """The inverse of a symmetric positive semidefinite matrix (p, p), zero in directions that are not seen."""
    scale, values, vectors = _scaled(matrix, sizes)
    inverse = np.where(values > SEEN, 1 / np.where(values > SEEN, values, 1.0), 0.0)
    return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale))


def null_space_of(matrix: FloatArray, sizes: FloatArray | None = None) -> FloatArray:
    """The directions (p, k) that are not seen: those in which `symmetric_pseudo_inverse` is zero, of any length."""
    scale, values, vectors = _scaled(matrix, sizes)
    return np.asarray(scale[:, None] * vectors[:, values <= SEEN])


def _scaled(matrix: FloatArray, sizes: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """1/√sizes, and eigenvalues, rising, and eigenvectors of the matrix scaled by it."""
    diagonal = np.diag(matrix) if sizes is None else sizes
    scale = np.where(diagonal > 0, 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 1.0)
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    return scale, values, vectors


def symmetric_inverses(matrix: FloatArray) -> FloatArray:
    """Inverses (n, 3, 3) of symmetric positive definite 3 × 3 matrices, by cofactors; zero where singular."""
    xx, xy, xz = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2]
    yy, yz, zz = matrix[:, 1, 1], matrix[:, 1, 2], matrix[:, 2, 2]
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    sound = determinant > 1e-12 * (xx + yy + zz) ** 3 / 27
    scale = np.where(sound, 1 / np.where(sound, determinant, 1.0), 0.0)
    inverse = np.empty_like(matrix)
    inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = a, xx * zz - xz * xz, xx * yy - xy * xy
    inverse[:, 0, 1] = inverse[:, 1, 0] = b
    inverse[:, 0, 2] = inverse[:, 2, 0] = c
    inverse[:, 1, 2] = inverse[:, 2, 1] = xy * xz - xx * yz
    return np.asarray(scale[:, None, None] * inverse)


def is_covariance(matrix: FloatArray) -> BoolArray:
    """Whether matrices (..., 3, 3) are symmetric and positive semidefinite, up to rounding; NaN is not.

    By the signs of the principal minors, which for half a million small matrices is much faster than eigenvalues.
    """
    c = matrix
    xx, yy, zz = c[..., 0, 0], c[..., 1, 1], c[..., 2, 2]
    xy, xz, yz = c[..., 0, 1], c[..., 0, 2], c[..., 1, 2]
    room = 1 + 1e-9
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    small = 1e-9 * (xx + yy + zz)
    return np.asarray(
        (np.abs(xy - c[..., 1, 0]) <= small)
        & (np.abs(xz - c[..., 2, 0]) <= small)
        & (np.abs(yz - c[..., 2, 1]) <= small)
        & (xx >= 0)
        & (yy >= 0)
        & (zz >= 0)
        & (xy * xy <= xx * yy * room)
        & (xz * xz <= xx * zz * room)
        & (yz * yz <= yy * zz * room)
        & (determinant >= -1e-9 * xx * yy * zz)
    )
