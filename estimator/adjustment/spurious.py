"""Spurious information: what estimated attitudes or motions only seem to show, taken out of a covariance."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def three_sigma_factor(values: int) -> float:
    """The factor up to which what noise seems to show may exceed its mean: three deviations of a mean of squares."""
    return float(1 + 3 * np.sqrt(2 / values))


def spurious_information_columns(
    offset: FloatArray, crossed: FloatArray, spurious: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """What a covariance lacks whose information is partly spurious, as columns to be squared and added.

    offset (k, k): covariance of one offset or of several; crossed (k, p): that with other unknowns; spurious (k, k):
    information of the offsets that there is not; least: what remains at least. Returns the columns of the offsets
    (k, k) and those of the other unknowns (p, k): the joint information less `spurious`, inverted again (Woodbury).
    """
    information = np.linalg.pinv(offset, hermitian=True)
    values, axes = np.linalg.eigh(information)
    seen = values > 0
    true = np.maximum(values - np.einsum("ik,ij,jk->k", axes, spurious, axes), least)
    lacking = np.where(seen, 1 / np.maximum(true, 1e-300) - 1 / np.where(seen, values, 1.0), 0.0)
    columns = axes * np.sqrt(np.maximum(lacking, 0.0))
    return columns, crossed.T @ information @ columns
