"""How many frames hang together: the integrated autocorrelation 1 + 2 Σ ρ of series, and what it does to a sum."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

FloatArray = NDArray[np.float64]

LASTING = 3.0  # standard deviations of 1 + 2 Σ ρ of white noise above 1, below which nothing lasts


def integrated_autocorrelation(series: Sequence[FloatArray]) -> tuple[float, int]:
    """1 + 2 Σ ρ of series (n, 3) about zero, summed to the first lag at which ρ is not positive; and that lag."""
    longest = max(len(values) for values in series)
    products = np.zeros(max(longest // 2, 1))
    for values in series:  # one by one, as the transforms take several times the memory of the series
        size = next_fast_len(len(values) + len(products), real=True)
        transformed = rfft(values.T, size)
        power = np.sum(transformed.real**2 + transformed.imag**2, axis=0)
        products += irfft(power, size)[: len(products)]
    rho = products[1:] / max(float(products[0]), 1e-300)
    ends = np.flatnonzero(rho <= 0)
    lag = int(ends[0]) + 1 if len(ends) else len(products)
    return 1.0 + 2.0 * float(rho[: lag - 1].sum()), lag


def growth_by_lasting(
    series: Sequence[FloatArray], values: float, frames: float, share: float = 1.0, clear: float = LASTING
) -> float:
    """By how much the variance of a sum over frames is more than that of white noise: 1 + 2 Σ ρ, at least 1.

    It is 1 unless it is significant, and corrected for the mean as by Wolff (Comput. Phys. Commun. 156, 2004).

    Args:
        series: (n, 3), about zero.
        values: how many independent ones the series would have if they were white.
        frames: in how many frames each of what the series tell of is seen.
        share: of the squares, that hangs together; the other part is white, and in the squares only.
        clear: standard deviations of it for white noise, above which it is significant.
    """
    lasting, lag = integrated_autocorrelation(series)
    total = 1 + share * (lasting - 1)
    by_chance = 2 * share * np.sqrt(lag / values)
    return float(total * (1 + (2 * lag + 1) / frames)) if total > 1 + clear * by_chance else 1.0
