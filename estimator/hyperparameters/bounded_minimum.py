"""The minimum of a smooth function of a few variables within bounds, by Newton steps of a limited length.

Along an axis in which the function is curved downwards, a step is as long as if it were curved upwards as much (Dauphin
et al. 2014, saddle-free Newton); one that lowers it by less than its second order says, or not, makes the next ones
shorter. Variables that would leave their bounds stay there while the gradient leads outwards, and those that end
hardly off one are there.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
# Variables (h,) → the function's value, and what finds its gradient (h,) and Hessian (h, h)
Curved = Callable[[FloatArray], tuple[float, Callable[[], tuple[FloatArray, FloatArray]]]]

FARTHEST = 4.0  # first step of a variable, at most
FLATTEST = 1e-3  # curvature, below which a step is as if it were that
GRADIENT, DECREASE, SHORTEST = 1e-2, 1e-6, 1e-3  # of the function, by which it has come to its minimum; and a step
GOOD, POOR = 0.75, 0.25  # decreases over those of second order, from which steps grow, and below which they shrink


def bounded_minimum(function: Curved, start: FloatArray, bounds: FloatArray, most: int) -> tuple[FloatArray, float]:
    """The variables (h,) of a minimum near a start (h,) within bounds (h, 2), and the function there.

    most: steps that are tried.
    """
    at, reach, moved = start, FARTHEST, True
    value, derivatives = function(at)
    first = value
    for _ in range(most):
        if moved:
            gradient, hessian = derivatives()
        free = ~((at <= bounds[:, 0]) & (gradient > 0) | (at >= bounds[:, 1]) & (gradient < 0))
        if np.abs(gradient[free]).max(initial=0.0) <= GRADIENT:
            break
        step = _step(gradient, hessian, free, np.clip(bounds - at[:, None], -reach, reach))
        tried = np.clip(at + step, bounds[:, 0], bounds[:, 1])  # against rounding
        longest, expected = float(np.abs(step).max()), float(-gradient @ step - step @ hessian @ step / 2)
        there, of_there = function(tried)
        decrease = value - there
        if decrease < POOR * expected:
            reach = longest / 4
        elif decrease > GOOD * expected and longest > reach / 2:
            reach *= 2
        moved = decrease > 0
        if moved:
            at, value, derivatives = tried, there, of_there
        if abs(decrease) <= DECREASE * max(first - value, 1.0) or reach < SHORTEST:
            break
    nearest = np.where(at - bounds[:, 0] < bounds[:, 1] - at, bounds[:, 0], bounds[:, 1])
    return np.where(np.abs(at - nearest) < SHORTEST, nearest, at), value


def _step(gradient: FloatArray, hessian: FloatArray, free: BoolArray, room: FloatArray) -> FloatArray:
    """The step (h,) of variables that are free (h,), each within its room (h, 2): one that would leave it stays at its
    end, and the others go on from there.
    """
    step, free = np.zeros_like(gradient), free.copy()
    while free.any():
        values, axes = np.linalg.eigh(hessian[np.ix_(free, free)])
        slope = (gradient + hessian[:, ~free] @ step[~free])[free]
        step[free] = -axes @ ((axes.T @ slope) / np.maximum(np.abs(values), FLATTEST))
        held = np.clip(step, room[:, 0], room[:, 1])
        out = np.abs(held - step)
        if not out.any():
            break
        first = int(np.argmax(out))
        step[first], free[first] = held[first], False
    return step
