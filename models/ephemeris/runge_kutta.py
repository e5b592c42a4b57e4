"""One step of an explicit Runge–Kutta formula, in symbols."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from baryscope.models.frames import Symbol

Rates = Callable[[Symbol, float], Symbol]
"""(x, fraction of the step) → ẋ."""


def step_of_order_8(rates: Rates, x: Symbol, h: Symbol) -> Symbol:
    """x after one step of size h by Dormand and Prince (Hairer, Nørsett, Wanner 1993, DOP853), by scipy's tableau."""
    from scipy.integrate import DOP853  # slow to load, and few need it

    return _step(rates, x, h, DOP853.A, DOP853.B, DOP853.C)


def step_of_order_4(rates: Rates, x: Symbol, h: Symbol) -> Symbol:
    """x after one step of size h by Kutta's classical formula (1901)."""
    return _step(rates, x, h, ((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), (1 / 6, 1 / 3, 1 / 3, 1 / 6), (0, 1 / 2, 1 / 2, 1))


def _step(
    rates: Rates, x: Symbol, h: Symbol, rows: Sequence[ArrayLike], last: ArrayLike, fractions: ArrayLike
) -> Symbol:
    """By a tableau: the weights of earlier slopes in each stage, those of all in the step, and where stages are."""
    slopes: list[Symbol] = []
    for row, fraction in zip(rows, np.asarray(fractions), strict=True):
        slopes.append(rates(_moved(x, h, row, slopes), float(fraction)))
    return _moved(x, h, last, slopes)


def _moved(x: Symbol, h: Symbol, weights: ArrayLike, slopes: Sequence[Symbol]) -> Symbol:
    """x + h Σ weight · slope; h times a weight is a common subexpression of all points."""
    return sum((h * w * slope for w, slope in zip(np.asarray(weights), slopes, strict=False) if w), x)
