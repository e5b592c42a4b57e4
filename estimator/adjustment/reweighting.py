"""Robust weights: the probability that an observation is an inlier, given its residual.

The model is a mixture: inliers with Gaussian errors, and a few outliers that are uniformly distributed. The weight is
the posterior probability of the first; it falls from 1 to 0 around a gate, so gross outliers have no influence.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GATE = 20.0  # squared normalised residual at which the weight is 1/2: 1 inlier in 6,000 lies beyond
MEDIAN = 2.366  # of χ² with three degrees of freedom
NEGLIGIBLE = 1e-9  # weight of a rejected observation: not zero, so that its residual is still computed
WIDTH = 15.0  # squared normalised residual below the gate at which the weight is 1 but for less than 1e-3


def reweighted(squares: FloatArray, weight: FloatArray, dof: float, least: float = 0.0) -> FloatArray:
    """New weights (n, m) from weighted squared residuals and weights (n, m), 0 where there is no observation.

    The noise variance is estimated from the median of the squared residuals, which outliers hardly influence.
    dof: number of values less number of unknowns; least: lower bound of the variance, for residuals that are rounding.
    """
    used = weight > 0
    plain = squares / np.where(used, weight, 1.0)
    share = dof / (3 * float(weight.sum()))
    noise = max(float(np.median(plain[used])) / (MEDIAN * share), least)
    found = used.astype(np.float64)
    if noise > 0:
        far = np.nonzero(plain > (GATE - WIDTH) * noise)
        found[far] *= 1 / (1 + np.exp(np.minimum((plain[far] / noise - GATE) / 2, 20.0)))
    return found
