"""How many frames hang together: the integrated autocorrelation 1 + 2 Σ ρ of series, and what it does to a sum."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

FloatArray = NDArray[np.float64]

LASTING = 3.0  # standard deviations of 1 + 2 Σ ρ of white noise above 1, below which nothing lasts
FEWEST_PAIRS = 0.25  # of the values, at a lag: as if there were as many, where there are fewer


def integrated_autocorrelation(series: Sequence[FloatArray]) -> tuple[float, int]:
    """1 + 2 Σ ρ of series (n, 3) about zero, summed to the first lag at which ρ is not positive; and that lag."""
    products = _summed_products(series)
    lag = _first_lag_without(products)
    return _integrated(products, lag), lag


def growth_by_lasting(
    series: Sequence[FloatArray], values: float, frames: float, share: float = 1.0, clear: float = LASTING
) -> float:
    """By how much the variance of a sum over frames is more than that of white noise: 1 + 2 Σ ρ, at least 1.

    It is 1 unless it is significant, and corrected for the mean as by Wolff (Comput. Phys. Commun. 156, 2004). Then ρ
    is the mean over the pairs of a lag, far fewer than the values where series consist of short stretches.

    Args:
        series: (n, 3), about zero; rows that are zero are gaps.
        values: how many independent ones the series would have if they were white.
        frames: in how many frames each of what the series tell of is seen.
        share: of the squares, that hangs together; the other part is white, and in the squares only.
        clear: standard deviations of it for white noise, above which it is significant.
    """
    products = _summed_products(series)
    lag = _first_lag_without(products)
    if _integrated(products, lag) <= 1 + clear * 2 * np.sqrt(lag / values):
        return 1.0
    pairs = _summed_products([np.asarray(values.any(axis=1, keepdims=True), dtype=float) for values in series])
    total = 1 + share * (_integrated(products / np.maximum(pairs, FEWEST_PAIRS * pairs[0]), lag) - 1)
    return float(total * (1 + (2 * lag + 1) / frames))


def _summed_products(series: Sequence[FloatArray]) -> FloatArray:
    """The sums (k,) over series (n, c) of the products of values that are 0, 1, … rows apart."""
    longest = max(len(values) for values in series)
    products = np.zeros(max(longest // 2, 1))
    for values in series:  # one by one, as the transforms take several times the memory of the series
        size = next_fast_len(len(values) + len(products), real=True)
        transformed = rfft(values.T, size)
        power = np.sum(transformed.real**2 + transformed.imag**2, axis=0)
        products += irfft(power, size)[: len(products)]
    return products


def _first_lag_without(products: FloatArray) -> int:
    """The first lag at which the autocorrelation is not positive."""
    ends = np.flatnonzero(products[1:] <= 0)
    return int(ends[0]) + 1 if len(ends) else len(products)


def _integrated(products: FloatArray, lag: int) -> float:
    return 1.0 + 2.0 * float(products[1:lag].sum() / max(float(products[0]), 1e-300))
