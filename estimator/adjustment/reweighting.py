"""Robust weights: how likely each observation is to be right, given its residual.

An observation's weight is the probability that it is right rather than anything at all: a Gaussian among a few that lie
anywhere, which is Student's t with its tails cut.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GATE = 20.0  # squared deviations at which right and wrong are equally likely: 1 right observation in 6,000 lies beyond
MEDIAN = 2.366  # of χ² with three degrees of freedom
NEGLIGIBLE = 1e-9  # weight of an outlier, so that its residual is still seen
WIDTH = 15.0  # squared deviations around the gate over which a weight falls from 1 to 0, to 3e-4


def reweighted(squares: FloatArray, weight: FloatArray, dof: float, least: float = 0.0) -> FloatArray:
    """New weights (n, m) from weighted squared residuals and weights (n, m), 0 where there is no observation.

    A weight is the probability that the observation is right, at a noise that the median of all shows, since a mean
    would believe the outliers. dof: values less unknowns; least: variance below which residuals are rounding.
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
