"""How many frames hang together: the integrated autocorrelation of series."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def frames_per_independent_one(series: Sequence[FloatArray]) -> tuple[float, int]:
    """1 + 2 Σ ρ of series (n, 3) about zero, summed to the first lag at which ρ is not positive; and that lag."""
    total, squares = 1.0, sum(float(np.sum(values**2)) for values in series)
    for lag in range(1, max(len(values) for values in series) // 2):
        products = sum(float(np.sum(values[lag:] * values[:-lag])) for values in series if len(values) > lag)
        rho = products / max(squares, 1e-300)
        if rho <= 0:
            return total, lag
        total += 2 * rho
    return total, max(len(values) for values in series) // 2
