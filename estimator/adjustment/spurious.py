"""Spurious information: apparent information from the noise of estimated attitudes, removed from a covariance."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def three_sigma_factor(values: int) -> float:
    """The 3σ bound of a mean of squares of Gaussian values over its expectation, for the number of values."""
    return float(1 + 3 * np.sqrt(2 / values))


def spurious_information_columns(
    offset: FloatArray, crossed: FloatArray, spurious: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """The increase of a joint covariance when spurious information is subtracted from its inverse (Woodbury).

    offset (k, k): covariance of the offsets; crossed (k, p): their covariance with the other unknowns; spurious (k, k):
    the information on the offsets to subtract; least: lower bound of the information that remains in a direction.
    Returns columns A of the offsets (k, k) and B of the other unknowns (p, k): the covariances grow by A Aᵀ and B Bᵀ,
    the cross-covariance by A Bᵀ.
    """
    information = np.linalg.pinv(offset, hermitian=True)
    values, axes = np.linalg.eigh(information)
    seen = values > 0
    remaining = np.maximum(values - np.einsum("ik,ij,jk->k", axes, spurious, axes), least)
    increase = np.where(seen, 1 / np.maximum(remaining, 1e-300) - 1 / np.where(seen, values, 1.0), 0.0)
    columns = axes * np.sqrt(np.maximum(increase, 0.0))
    return columns, crossed.T @ information @ columns
