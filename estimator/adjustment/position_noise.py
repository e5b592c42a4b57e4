"""Noise of the position from frame to frame, as of a pivot that slips: its variance of maximum likelihood.

A frame's shift, with its rotation unknown, has the information N from its observations. Along the axes of N, with λ an
eigenvalue and z² the squared shift times λ, −2 ln of the likelihood of a variance s² is Σ ln(1 + λ s²) + z²/(1 + λ s²).

Slips may last. What is constant then knows as little as from white noise of s² times 1 + 2 Σ ρ, ρ the autocorrelations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting
from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.scan import scanned_minimum
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

RANGE = (1e-4, 1e8)  # of the variance, over that with which the frames' median shift is known
SCAN, SWEEPS = 41, 4  # values of its logarithm, and how often the range is narrowed to two of its steps
SIGNIFICANT = 9.0  # 2 ln of the likelihood ratio to no noise, below which there is none
CLEAR = 1.0  # standard deviations, from which slips last: to take those that do for white costs far more than to err
UNKNOWNS = 2  # of a coordinate: the place at rest, and the offset that turns with the body
MOST_EXPLAINED = 0.8  # share of the slips' variance


@dataclass(frozen=True, eq=False)
class _Shifts:
    """Of the n frames of a body, along the axes of their information: shift (n, 3), m, and the variances (n, 3) to
    which it is known, m², infinite where it is not; axes (n, 3, 3), columns in C.
    """

    shift: FloatArray
    variance: FloatArray
    axes: FloatArray


def position_variance(bodies: Sequence[Body], observations: Observations, origin: FloatArray, variance: float) -> float:
    """The variance of a coordinate as of white noise, m², s² (1 + 2 Σ ρ), zero unless it is significant.

    origin (n, 3) in C, m: the path; variance: of an observation of weight 1.
    """
    values, squares, series = [], [], []
    for body in bodies:
        own = observations.frames(body.frames).features(body.features)
        found = pieces(own, body.attitude, origin[body.frames], body.points)
        information, rhs = found.shift_alone()
        along, axes = np.linalg.eigh(information)
        known = along > 1e-9 * along[:, -1:]
        moved = (np.swapaxes(axes, 1, 2) @ rhs[:, :, None])[:, :, 0]
        squares.append(moved[known] ** 2 / along[known] / variance)
        values.append(along[known] / variance)
        own_variances = np.divide(variance, along, out=np.full_like(along, np.inf), where=known)
        shift = np.divide(moved, along, out=np.zeros_like(along), where=known)
        series.append(_Shifts(shift, own_variances, body.attitude @ axes))
    size, square = np.concatenate(values), np.concatenate(squares)
    low, high = np.log(np.array(RANGE) / np.median(size))

    def cost(logarithm: FloatArray) -> FloatArray:
        grown = 1 + np.exp(logarithm)[:, None] * size
        return np.asarray((np.log(grown) + square / grown).sum(axis=1))

    best, least = scanned_minimum(cost, low, high, SCAN, SWEEPS)
    if square.sum() - least <= SIGNIFICANT:
        return 0.0
    slip = float(np.exp(best))
    return slip * _frames_of_a_slip(series, slip)


def _frames_of_a_slip(series: list[_Shifts], slip: float) -> float:
    """1 + 2 Σ ρ, at least 1, of shifts that are known to their variances; slip: their own, m².

    Where a frame tells its shift poorly, as across the lever to a far tip, which its attitude moves, it counts little.
    What the frames are wrong by is white: only the slips' part of the squares hangs together. Place and offset follow
    slips that last, and leave less of their variance to see: of n frames, two of the n / (1 + 2 Σ ρ) that are new.
    """
    weights = [slip / (slip + one.variance) for one in series]
    shifts = [
        (one.axes @ (weight * one.shift)[:, :, None])[:, :, 0] for one, weight in zip(series, weights, strict=True)
    ]
    values = sum(float((weight**2).sum()) for weight in weights)
    observed = sum(float(np.vdot(shift, shift)) for shift in shifts) / (values * slip)
    frames = values / 3
    growth = growth_by_lasting(shifts, values, frames, observed, CLEAR)
    return growth / (1 - min(UNKNOWNS * growth / frames, MOST_EXPLAINED)) if growth > 1 else growth
