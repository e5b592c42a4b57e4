"""Symmetric matrices that may be singular: pseudo-inverse, null space, 3 × 3 inverses, and a test of covariances.

Eigenvalues are compared with a threshold after scaling by `sizes`, a diagonal. After unknowns have been eliminated, the
diagonal itself may be rounding error alone; `sizes` is then the diagonal before. By default it is the matrix's own.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.linalg.lapack import dpotrf, dpotri

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

UPPER = np.triu_indices(3)  # rows and columns of the six elements that make a symmetric 3 × 3 matrix
FULL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # which of them stands where in the matrix
DIGITS = 1e-14  # of the trace: what is added to a covariance that rounding leaves indefinite
RANK_TOLERANCE = 1e-13  # eigenvalue of the scaled matrix up to which a direction belongs to the null space
REGULAR = 1e-10  # least eigenvalue of the scaled matrix from which it is far from having one


def eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The eigenvalues (p,), ascending, and eigenvectors (p, p) of a symmetric matrix of finite numbers.

    Divide and conquer, which is fast, does not converge for one matrix in many thousands; then by QR iterations.
    """
    try:
        found = np.linalg.eigh(matrix)
        return found.eigenvalues, found.eigenvectors
    except np.linalg.LinAlgError:
        values, vectors = eigh(matrix, driver="ev")
        return np.asarray(values), np.asarray(vectors)


def symmetric_pseudo_inverse(matrix: FloatArray, sizes: FloatArray | None = None) -> FloatArray:
    """Pseudo-inverse (p, p) of a symmetric positive semidefinite matrix (p, p): zero in its null space."""
    return inverse_and_null_space(matrix, sizes)[0]


def inverse_and_null_space(matrix: FloatArray, sizes: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """`symmetric_pseudo_inverse`, and a basis (p, k) of the null space; its columns are not normalised."""
    regular = _inverse_of_regular(matrix, sizes)
    if regular is not None:
        return regular, np.zeros((len(matrix), 0))
    scale, values, vectors = _scaled(matrix, sizes)
    inverse = np.where(values > RANK_TOLERANCE, 1 / np.where(values > RANK_TOLERANCE, values, 1.0), 0.0)
    null_space = scale[:, None] * vectors[:, values <= RANK_TOLERANCE]
    return np.asarray((vectors * inverse) @ vectors.T * np.outer(scale, scale)), np.asarray(null_space)


def inverse_across(
    matrix: FloatArray, along: FloatArray, sizes: FloatArray, held: BoolArray | None = None
) -> FloatArray:
    """The inverse (p, p) of a matrix that is singular along (p, k): zero there, and as of a change across it elsewhere.

    First that of a change across it in units of 1/√sizes: the weights of two unknowns may have a ratio of 1e10, and in
    the other units rounding in the great ones would be more than the small ones are. held (p,): of which unknowns the
    change is across it, all unless given; the others are what these make them.
    """
    scale = np.sqrt(np.where(sizes > 0, sizes, 1.0))[:, None]
    scaled, _ = np.linalg.qr(scale * along)
    tied, back = scale * scaled, scaled / scale
    inverse = symmetric_pseudo_inverse(matrix + tied @ tied.T, sizes) - back @ back.T
    along, _ = np.linalg.qr(along)
    across = along
    if held is not None:
        across = along * held[:, None]
        along = along @ np.linalg.inv(across.T @ across)
    left = inverse @ across
    return np.asarray(inverse - left @ along.T - along @ left.T + along @ (across.T @ left) @ along.T)


def factor_of(covariance: FloatArray) -> FloatArray:
    """A factor F (p, r) of a positive semidefinite matrix (p, p) = F Fᵀ, without directions lost in rounding."""
    _, values, vectors = _scaled(covariance, None)
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    kept = values > RANK_TOLERANCE
    return np.asarray(size[:, None] * vectors[:, kept] * np.sqrt(values[kept]))


def _scaled(matrix: FloatArray, sizes: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The scale 1/√sizes (p,), and the eigenvalues, ascending, and eigenvectors of the matrix scaled by it."""
    scale = _scale(matrix, sizes)
    values, vectors = eigen(matrix * np.outer(scale, scale))
    return scale, values, vectors


def _scale(matrix: FloatArray, sizes: FloatArray | None) -> FloatArray:
    """1/√sizes (p,), 1 where that is zero."""
    diagonal = np.diag(matrix) if sizes is None else sizes
    return np.where(diagonal > 0, 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 1.0)


def inverse_of_definite(matrix: FloatArray) -> FloatArray:
    """The inverse (p, p) of a symmetric matrix that is positive definite but for rounding, without scaling: by Cholesky
    where that succeeds, which takes a third of the time of elimination.

    Raises:
        LinAlgError: it is singular.
    """
    factor, indefinite = dpotrf(matrix, lower=True)
    if indefinite:
        return np.asarray(np.linalg.inv(matrix))
    return _mirrored(dpotri(factor, lower=True)[0])


def _mirrored(lower: FloatArray) -> FloatArray:
    """The symmetric matrix of a lower triangle beside zeros."""
    found = lower + lower.T
    found.flat[:: len(lower) + 1] = lower.diagonal()
    return np.asarray(found)


def _inverse_of_regular(matrix: FloatArray, sizes: FloatArray | None) -> FloatArray | None:
    """The inverse of a matrix whose null space is certainly empty, by what costs less than eigenvalues; else None.

    The least eigenvalue is at least one over the trace of the inverse.
    """
    if not len(matrix):  # LAPACK takes no empty matrix
        return None
    scale = _scale(matrix, sizes)
    both = scale[:, None] * scale
    factor, indefinite = dpotrf(matrix * both, lower=True)
    if indefinite:
        return None
    lower, _ = dpotri(factor, lower=True)
    if not lower.trace() < 1 / REGULAR:
        return None
    return np.asarray(_mirrored(lower) * both)


def elements_of(matrix: FloatArray) -> FloatArray:
    """The six elements (..., 6) that make symmetric matrices (..., 3, 3), which are `elements[..., FULL]`."""
    return np.asarray(matrix[(..., *UPPER)])


def symmetric_inverses(matrix: FloatArray) -> FloatArray:
    """Inverses (..., 3, 3) of symmetric positive definite 3 × 3 matrices, by cofactors; zero where singular."""
    xx, xy, xz = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2]
    yy, yz, zz = matrix[..., 1, 1], matrix[..., 1, 2], matrix[..., 2, 2]
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    regular = determinant > 1e-12 * (xx + yy + zz) ** 3 / 27
    scale = np.where(regular, 1 / np.where(regular, determinant, 1.0), 0.0)
    inverse = np.empty_like(matrix)
    inverse[..., 0, 0], inverse[..., 1, 1], inverse[..., 2, 2] = a, xx * zz - xz * xz, xx * yy - xy * xy
    inverse[..., 0, 1] = inverse[..., 1, 0] = b
    inverse[..., 0, 2] = inverse[..., 2, 0] = c
    inverse[..., 1, 2] = inverse[..., 2, 1] = xy * xz - xx * yz
    return np.asarray(scale[..., None, None] * inverse)


def inverted_sums(one: FloatArray, other: FloatArray) -> FloatArray:
    """(A⁻¹ + B)⁻¹ of positive semidefinite A and B (n, 3, 3), also where they are singular: A (1 + B A)⁻¹.

    A covariance and what else is known, or an information and what noise hides of it. With A = L Lᵀ it is
    L (1 + M)⁻¹ Lᵀ. M = Lᵀ B L has no eigenvalue below zero, so that 1 + M is not singular, however great B is.
    """
    values, axes = np.linalg.eigh(one)
    root = axes * np.sqrt(np.maximum(values, 0.0))[:, None]
    told, along = np.linalg.eigh(np.swapaxes(root, 1, 2) @ other @ root)
    columns = root @ along
    return np.asarray((columns / (1 + np.maximum(told, 0.0))[:, None]) @ np.swapaxes(columns, 1, 2))


def made_definite(covariance: FloatArray) -> FloatArray:
    """Covariances (n, p, p) that are positive definite in double precision, wider by what rounding lost where it did.

    Kilometres along one axis and micrometres across cannot stand in one matrix. Of terms that cancel, rounding may be
    more than that of what is left.
    """
    unit = np.eye(covariance.shape[-1])
    rounding = DIGITS * np.trace(covariance, axis1=1, axis2=2)
    try:
        np.linalg.cholesky(covariance - rounding[:, None, None] * unit / 2)
    except np.linalg.LinAlgError:
        missing = np.maximum(rounding - np.linalg.eigvalsh(covariance)[:, 0], 0.0)
        return np.asarray(covariance + missing[:, None, None] * unit)
    return covariance


def is_covariance(matrix: FloatArray) -> BoolArray:
    """Whether matrices (..., 3, 3) are symmetric and positive semidefinite, up to rounding; NaN is not.

    Tests the signs of the principal minors, which is much faster than eigenvalues for many small matrices.
    """
    c = matrix
    xx, yy, zz = c[..., 0, 0], c[..., 1, 1], c[..., 2, 2]
    xy, xz, yz = c[..., 0, 1], c[..., 0, 2], c[..., 1, 2]
    tolerance = 1 + 1e-9
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    small = 1e-9 * (xx + yy + zz)
    return np.asarray(
        (np.abs(xy - c[..., 1, 0]) <= small)
        & (np.abs(xz - c[..., 2, 0]) <= small)
        & (np.abs(yz - c[..., 2, 1]) <= small)
        & (xx >= 0)
        & (yy >= 0)
        & (zz >= 0)
        & (xy * xy <= xx * yy * tolerance)
        & (xz * xz <= xx * zz * tolerance)
        & (yz * yz <= yy * zz * tolerance)
        & (determinant >= -1e-9 * xx * yy * zz)
    )
