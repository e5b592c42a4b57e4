"""Whether errors agree with the covariances that are claimed: NEES, and the limit of what chance makes of it."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

FloatArray = NDArray[np.float64]

CHANCE = 0.001  # share of true claims that pass for wrong ones


def limit(count: int) -> float:
    """The NEES of so many quantities above which a claim is wrong."""
    return float(chdtri(count, CHANCE))


WRONG = limit(3)  # of a position


def nees(error: FloatArray, covariance: FloatArray) -> float:
    """eᵀ P⁻¹ e of an error (k,), which may be of several units; infinite if P is not positive definite."""
    with np.errstate(invalid="ignore"):
        size = np.sqrt(np.diag(covariance))
    if not np.isfinite(error).all() or not (size > 0).all() or not definite(covariance[None] / np.outer(size, size)):
        return float("inf")
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return float(np.sum((vectors.T @ (error / size)) ** 2 / values))


def definite(covariances: FloatArray) -> bool:
    """Whether all of them (..., k, k) are finite and positive definite."""
    return bool(np.isfinite(covariances).all()) and bool((np.linalg.eigvalsh(covariances)[..., 0] > 0).all())
