"""The minimum of a function of one variable by scans of a range, each of the two steps about the best before."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def scanned_minimum(
    function: Callable[[FloatArray], FloatArray], low: float, high: float, count: int, sweeps: int
) -> tuple[float, float]:
    """The point of the least value and that value; function maps points (count,), an odd number, to values (count,)."""
    points = np.linspace(low, high, count)
    for _ in range(sweeps):
        values = function(points)
        best = int(np.argmin(values))
        points = np.linspace(points[max(best - 1, 0)], points[min(best + 1, count - 1)], count)
    return float(points[count // 2]), float(values[best])
