"""The integrated autocorrelation, against sums over pairs of frames one by one."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.autocorrelation import growth_by_lasting, integrated_autocorrelation
from synthetic import first_order


def by_pairs(series):
    """1 + 2 Σ ρ to the first lag at which ρ is not positive, and that lag."""
    total, lag = 0.0, 1
    square = sum(float(np.vdot(values, values)) for values in series)
    while lag < max(map(len, series)) // 2:
        product = sum(float(np.vdot(values[lag:], values[: max(len(values) - lag, 0)])) for values in series)
        if product <= 0:
            break
        total, lag = total + product / square, lag + 1
    return 1 + 2 * total, lag


@pytest.mark.parametrize("lengths", [(40,), (41, 25), (100, 7, 3), (2,)])
@pytest.mark.parametrize("keep", [0.0, 0.9])
def test_it_is_the_sum_over_pairs(lengths, keep):
    """Of series of unlike lengths, none of whose ends meets its beginning, as a cyclic transform would have it."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        series = [first_order(rng, (length, 3), keep) for length in lengths]
        lasting, lag = integrated_autocorrelation(series)
        expected, expected_lag = by_pairs(series)
        assert lag == expected_lag
        assert lasting == pytest.approx(expected, rel=1e-9)


def test_short_stretches_tell_as_much_as_long_ones():
    """Of twenty frames, with gaps of as many: their ends cost nothing."""
    rng, keep, found = np.random.default_rng(8), 0.7, []
    for _ in range(10):
        values = first_order(rng, (200, 300, 3), keep)
        values[np.arange(200) // 20 % 2 == 1] = 0.0
        found.append(growth_by_lasting(list(values.swapaxes(0, 1)), values=90_000, frames=1e9))
    assert np.mean(found) == pytest.approx((1 + keep) / (1 - keep), rel=0.03)


def test_the_growth_is_that_of_the_part_that_hangs_together_corrected_for_the_mean():
    """The window W, in lags, costs a factor of 1 + (2 W + 1)/N; by chance white noise is off by 2 √(W/values)."""
    (values,) = series = [first_order(np.random.default_rng(6), (4000, 3), 0.8)]
    summed, lag = by_pairs(series)
    squares = [np.mean(np.sum(values[k:] * values[: 4000 - k], axis=1)) for k in range(lag)]
    lasting = 1 + 2 * sum(squares[1:]) / squares[0]
    assert lasting == pytest.approx(1.8 / 0.2, rel=0.2)
    whole = growth_by_lasting(series, values=12000, frames=500)
    assert whole == pytest.approx(lasting * (1 + (2 * lag + 1) / 500), rel=1e-9)
    half = growth_by_lasting(series, values=12000, frames=500, share=0.5)
    assert half == pytest.approx((1 + 0.5 * (lasting - 1)) * (1 + (2 * lag + 1) / 500), rel=1e-9)
    deviations = (summed - 1) / (2 * np.sqrt(lag / 12000))
    assert growth_by_lasting(series, values=12000, frames=500, clear=0.99 * deviations) == whole
    assert growth_by_lasting(series, values=12000, frames=500, clear=1.01 * deviations) == 1
