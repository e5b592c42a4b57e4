"""When a case is watched."""

import numpy as np
import pytest

from baryscope.study.population.fourth.timing import (
    FEWEST,
    KINDS,
    LONGEST,
    MOST,
    REVOLUTIONS,
    Timing,
    begun,
    drawn,
    elapsed,
)

PERIOD = 6000.0  # s


def test_spans_and_frames_are_within_their_limits():
    found = [drawn(np.random.default_rng(seed), PERIOD) for seed in range(200)]
    assert None in found
    for times in filter(None, found):
        assert FEWEST <= times.frames <= MOST
        assert times.span <= min(LONGEST, REVOLUTIONS * PERIOD)
        assert 0.2 <= times.span * times.rate / (2 * np.pi) <= 20.001
        assert np.radians(0.1) <= times.rate <= np.radians(20)


def test_times_ascend_from_nought_over_about_the_span():
    kinds = set()
    for seed in range(40):
        time, kind = elapsed(np.random.default_rng(seed), Timing(0.1, 500.0, 200))
        kinds.add(kind)
        assert len(time) == 200
        assert time[0] == 0
        assert np.diff(time).min() >= 1e-3 * 500 / 200 * (1 - 1e-9)
        assert time[-1] == pytest.approx(500, rel=0.15 if kind != "bursts" else 0.6)
        if kind == "regular":
            np.testing.assert_allclose(np.diff(time), 500 / 199)
    assert kinds == set(KINDS)


def test_an_oblate_earth_is_not_carried_far():
    begins = [begun(np.random.default_rng(seed), False) for seed in range(50)]
    assert min(begins) < -100
    assert max(begins) >= 1e5
    assert all(0 <= begun(np.random.default_rng(seed), True) <= 5000 for seed in range(50))
