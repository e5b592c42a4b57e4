"""The eighth-order formula of Dormand and Prince (Hairer, Nørsett, Wanner 1993, DOP853); the tableau is scipy's."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.models.frames import Symbol


def step(rates: Callable[[Symbol, float], Symbol], x: Symbol, h: Symbol) -> Symbol:
    """x after one step of size h; rates: (x, fraction of the step) → ẋ."""
    from scipy.integrate import DOP853  # slow to load, and few need it

    slopes: list[Symbol] = []
    for row, fraction in zip(DOP853.A, DOP853.C, strict=True):
        slopes.append(rates(_moved(x, h, row, slopes), float(fraction)))
    return _moved(x, h, DOP853.B, slopes)


def _moved(x: Symbol, h: Symbol, weights: NDArray[np.float64], slopes: Sequence[Symbol]) -> Symbol:
    """x + h Σ weight · slope; h times a weight is a common subexpression of all points."""
    return sum((h * weight * slope for weight, slope in zip(weights, slopes, strict=False) if weight), x)
