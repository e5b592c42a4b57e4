"""Times within their ranges."""

import numpy as np
import pytest

from baryscope.study.population.third.timing import drawn


@pytest.mark.parametrize("orbital", [True, False])
def test_times_are_within_the_ranges(orbital):
    for seed in range(200):
        found = drawn(np.random.default_rng(seed), orbital)
        assert 20 <= len(found.time) <= 3000
        assert (np.diff(found.time) > 0).all()
        assert found.span <= 2e4
        assert 0.1 <= np.degrees(found.rate) <= (30 if orbital else 120)
        assert found.span * found.rate / (2 * np.pi) <= 20.5
        if found.blind:
            assert found.time[0] < found.blind[0] < found.blind[1] < found.time[-1]


def test_gaps_offsets_and_lost_frames_occur():
    every = [drawn(np.random.default_rng(seed), True) for seed in range(200)]
    steps = [np.diff(found.time) / np.median(np.diff(found.time)) for found in every]
    assert any(found.blind for found in every)
    assert any(found.time[0] != 0 for found in every)
    assert any(step.max() > 10 for step in steps)  # the camera is off
    assert any(1.1 < step.max() < 5 for step in steps)
    assert sum(np.allclose(step, 1) for step in steps) > 50
