"""How far an estimate is: shares that rise, and an estimate that does not depend on whether they are told."""

import numpy as np
import pytest

from baryscope.estimator import METHODS, PathOptions, estimate
from baryscope.estimator.progress import Rounds
from free_paths import fixed_case

FIXED = PathOptions(trajectory="fixed")


@pytest.fixture(scope="module")
def tracks():
    return fixed_case(150).tracks


def test_each_unit_is_half_of_what_is_left():
    told = []
    rounds = Rounds(told.append)
    for work in (1.0, 1.0, 0.5):
        rounds.did(work)
    assert told == pytest.approx([0.5, 0.75, 1 - 0.5**2.5])


@pytest.mark.parametrize("method", ["ml", "ekf"])
def test_shares_rise_and_change_nothing(tracks, method):
    told = []
    found = estimate(tracks, method=method, options=FIXED, progress=told.append)
    assert len(told) >= 3
    assert told == sorted(told)
    assert 0 < told[0] < told[-1] < 1
    untold = estimate(tracks, method=method, options=FIXED)
    np.testing.assert_array_equal(found.position, untold.position)


@pytest.mark.parametrize("method", sorted(set(METHODS) - {"ml", "ekf"}))
def test_what_is_quick_tells_nothing(tracks, method):
    told = []
    options = FIXED if METHODS[method].options is PathOptions else None
    METHODS[method](tracks, options=options, progress=told.append)
    assert told == []
