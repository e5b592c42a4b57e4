"""Members of a Gaussian posterior, in opposite pairs, for functions of it that are not linear."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

PAIRS = 64  # of members, opposite to each other
UNTOLD = 1e-12  # least eigenvalue of a correlation matrix that counts


def root_of(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A root B (k, r) of a covariance (k, k) = B Bᵀ, which may be singular, and its inverse A (k, r), with Aᵀ B = 1."""
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, 1.0)
    values, axes = np.linalg.eigh(covariance / np.outer(size, size))
    kept = values > UNTOLD * values[-1]
    axes, values = axes[:, kept], np.sqrt(values[kept])
    return size[:, None] * axes * values, axes / values / size[:, None]


@cache
def opposite_pairs(k: int) -> FloatArray:
    """Standard normal vectors (2 PAIRS, k) in opposite pairs, whose mean is exactly 0 and covariance exactly 1."""
    drawn = np.random.default_rng(k).standard_normal((PAIRS, k))
    drawn = np.linalg.solve(np.linalg.cholesky(drawn.T @ drawn / PAIRS), drawn.T).T
    return np.concatenate([drawn, -drawn])
