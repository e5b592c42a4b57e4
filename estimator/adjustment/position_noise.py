"""White noise of the position from frame to frame, as of a pivot that slips: its variance of maximum likelihood.

A frame's shift, with its rotation unknown, has the information N from its observations. Along the axes of N, with λ an
eigenvalue and z² the squared shift times λ, −2 ln of the likelihood of a variance s² is Σ ln(1 + λ s²) + z²/(1 + λ s²).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.scan import scanned_minimum
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

RANGE = (1e-4, 1e8)  # of the variance, over that with which the frames' median shift is known
SCAN, SWEEPS = 41, 4  # values of its logarithm, and how often the range is narrowed to two of its steps
SIGNIFICANT = 9.0  # 2 ln of the likelihood ratio to no noise, below which there is none


def position_variance(bodies: Sequence[Body], observations: Observations, origin: FloatArray, variance: float) -> float:
    """The variance s² of a coordinate, m², zero unless it is significant.

    origin (n, 3) in C, m: the path; variance: of an observation of weight 1.
    """
    values, squares = [], []
    for body in bodies:
        own = observations.frames(body.frames).features(body.features)
        found = pieces(own, body.attitude, origin[body.frames], body.points)
        information, rhs = found.shift_alone()
        along, axes = np.linalg.eigh(information)
        known = along > 1e-9 * along[:, -1:]
        squares.append(((np.swapaxes(axes, 1, 2) @ rhs[:, :, None])[:, :, 0][known] ** 2) / along[known] / variance)
        values.append(along[known] / variance)
    size, square = np.concatenate(values), np.concatenate(squares)
    low, high = np.log(np.array(RANGE) / np.median(size))

    def cost(logarithm: FloatArray) -> FloatArray:
        grown = 1 + np.exp(logarithm)[:, None] * size
        return np.asarray((np.log(grown) + square / grown).sum(axis=1))

    best, least = scanned_minimum(cost, low, high, SCAN, SWEEPS)
    return float(np.exp(best)) if square.sum() - least > SIGNIFICANT else 0.0
