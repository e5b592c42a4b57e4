"""Noise of the position from frame to frame, as of a pivot that slips: its variance of maximum likelihood.

A frame's shift, with its rotation unknown, has the information N from its observations. Along the axes of N, with λ an
eigenvalue and z² the squared shift times λ, −2 ln of the likelihood of a variance s² is Σ ln(1 + λ s²) + z²/(1 + λ s²).

Slips may last. What is constant then knows as little as from white noise of s² times 1 + 2 Σ ρ, ρ the autocorrelations,
in a window of so many times that sum as Wolff (Comput. Phys. Commun. 156, 2004) has it, who corrects for the mean, too.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import pieces
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.scan import scanned_minimum
from baryscope.estimator.geometry.symmetric import symmetric_inverses
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

RANGE = (1e-4, 1e8)  # of the variance, over that with which the frames' median shift is known
SCAN, SWEEPS = 41, 4  # values of its logarithm, and how often the range is narrowed to two of its steps
SIGNIFICANT = 9.0  # 2 ln of the likelihood ratio to no noise, below which there is none
WINDOW = 4.0  # of lags, over the frames that slips last, (1 + 2 Σ ρ)/2
LASTING = 3.0  # standard deviations of 1 + 2 Σ ρ of white noise above 1, below which slips don't last


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
        squares.append(((np.swapaxes(axes, 1, 2) @ rhs[:, :, None])[:, :, 0][known] ** 2) / along[known] / variance)
        values.append(along[known] / variance)
        series.append(_shifts_in_C(body, information, rhs))
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


def _shifts_in_C(body: Body, information: FloatArray, rhs: FloatArray) -> FloatArray:
    """The shift (n, 3) of each frame of a body, m in C, from its information (n, 3, 3) and right-hand side in S."""
    shift = symmetric_inverses(information) @ rhs[:, :, None]
    return np.asarray((body.attitude @ shift)[:, :, 0])


def _frames_of_a_slip(series: list[FloatArray], variance: float) -> float:
    """1 + 2 Σ ρ, at least 1, of series of shifts (n, 3) with noise, whose own variance is given, m²."""
    frames, total = sum(len(shift) for shift in series), 1.0
    observed = sum(float(np.vdot(shift, shift)) for shift in series) / (3 * frames)
    for lag in range(1, max(len(shift) for shift in series)):
        longer = [shift for shift in series if len(shift) > lag]
        pairs = 3 * sum(len(shift) - lag for shift in longer)
        total += 2 * sum(float(np.vdot(shift[lag:], shift[:-lag])) for shift in longer) / pairs / variance
        if lag >= WINDOW * total / 2:
            break
    by_chance = 2 * np.sqrt(lag / (3 * frames)) * observed / variance
    return total * (1 + (2 * lag + 1) / frames) if total > 1 + LASTING * by_chance else 1.0
