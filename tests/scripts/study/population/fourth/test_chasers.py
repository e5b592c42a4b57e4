"""Chasers that stay near, each in its way."""

from functools import cache

import numpy as np
import pytest

from baryscope.models.orbit import Orbit
from baryscope.study.population.fourth.chasers import FARTHEST, NEAREST, Place, drawn
from baryscope.study.population.fourth.orbits import MU, lvlh, state
from baryscope.study.population.fourth.relative import flown

SPAN = 3000.0  # s


def place_of(eccentricity):
    a = 7e6 / (1 - eccentricity)
    target = state(Orbit(a, eccentricity, 1.0, 0.3, 0.2, 0.7, MU), 0.0)
    return Place(target, eccentricity, a, SPAN, False)


def ranges(place, chaser):
    _, states = flown(place.target, chaser[None], 0.0, np.linspace(0, SPAN, 40), False)
    return np.linalg.norm(states[:, 0, :3], axis=1)


@cache
def near(eccentricity):
    """The chasers of forty seeds, near a body that reaches 5 m."""
    found = [drawn(np.random.default_rng(seed), place_of(eccentricity), 5.0) for seed in range(40)]
    return [one for one in found if one is not None]


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.6])
def test_they_come_neither_too_near_nor_get_too_far(eccentricity):
    place, kinds = place_of(eccentricity), set()
    for chaser, kind in near(eccentricity):
        kinds.add(kind.split()[0])
        away = ranges(place, chaser)
        assert max(NEAREST, 6.0) < away.min()
        assert away.max() < FARTHEST
        if kind.startswith(("football", "leader")):
            ends = place.target + chaser
            a = 1 / (2 / np.linalg.norm(ends[:3]) - ends[3:] @ ends[3:] / MU)
            assert a == pytest.approx(place.semi_major_axis, abs=0.1)  # rounding of 1e-15 of the velocity: 0.01 m
    assert len(kinds) >= 2


def test_one_at_rest_ahead_on_a_circle_stays_there():
    place, still = place_of(0.0), 0
    for chaser, kind in near(0.0):
        ahead = lvlh(place.target).T @ chaser[:3]
        if kind.startswith("rest") and abs(ahead[1]) > 0.999 * np.linalg.norm(ahead):
            still += 1
            away = ranges(place, chaser)
            np.testing.assert_allclose(away, away[0], atol=1e-4)
    assert still > 9


def test_a_body_too_large_has_none():
    assert drawn(np.random.default_rng(1), place_of(0.01), 30.0) is None
