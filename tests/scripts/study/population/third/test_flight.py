"""The chaser stays near, and a wrong orbit is wrong by what is said."""

import numpy as np
import pytest

from baryscope.study.population.third.flight import drawn
from baryscope.study.population.third.kepler import at_epoch
from baryscope.study.population.third.mismatches import HIGH, LOW, MIDDLE, SIGMA, Plan
from baryscope.study.population.third.timing import Timing


def fly(seed, place, *mismatches, begin=0.0):
    timing = Timing(np.linspace(begin, begin + 8000, 60), 0.1, ())
    return drawn(np.random.default_rng(seed), Plan(place, SIGMA, mismatches), timing, 20.0, 0.01)


@pytest.mark.parametrize("place", [LOW, MIDDLE, HIGH])
def test_without_forces_the_chaser_stays_at_its_distance(place):
    for seed in range(8):
        found = fly(seed, place, begin=300.0)
        ranges = np.linalg.norm(found.flown.path, axis=1)
        assert ranges.min() > 0.4 * 20  # between the 200 times at which that is asked for, it may be nearer
        assert ranges.max() < 3.1 * 20
        assert found.told == found.truth
        assert found.words == ()


def test_orbits_are_those_of_their_places():
    for seed in range(20):
        low, high = fly(seed, LOW).truth, fly(seed, HIGH).truth
        assert 3.7e5 < low.semi_major_axis - 6378137 < 6.3e5
        assert abs(high.period / 86164 - 1) < 0.02


def test_an_orbit_that_is_told_wrong_is_near_the_truth_and_not_the_truth():
    for seed in range(20):
        found = fly(seed, LOW, "orbit told wrong")
        off = np.linalg.norm(at_epoch(found.told)[:3] - at_epoch(found.truth)[:3])
        assert 5 < off < 3000 * 2 + np.radians(2) * 7e6 * 2
        assert found.words[0].startswith("orbit told wrong by")
        assert fly(seed, LOW).truth == found.truth  # what is told does not change the truth
