"""How often mismatches occur."""

import numpy as np
import pytest

from baryscope.study.population.third.mismatches import KINDS, LABORATORY, LOW, NEEDS, PLACES, planned


@pytest.fixture(scope="module")
def plans():
    return [planned(1, index) for index in range(2000)]


def deviations(chosen, share):
    """By how many standard deviations a count of plans that are chosen departs from its share."""
    return abs(sum(chosen) - share * len(chosen)) / np.sqrt(len(chosen) * share * (1 - share))


def test_every_mismatch_occurs_among_the_first_two_hundred():
    for seed in (1, 2):
        assert {name for index in range(200) for name in planned(seed, index).mismatches} == set(KINDS)


def test_shares_are_those_that_are_said(plans):
    assert deviations([not plan.mismatches for plan in plans], 0.1) < 4
    assert deviations([plan.orbital for plan in plans], 0.8) < 4
    for place, share in PLACES.items():
        assert deviations([plan.place == place for plan in plans], share) < 4


def test_mismatches_are_where_they_can_be(plans):
    for plan in plans:
        assert len(plan.mismatches) <= (6 if plan.place == LOW else 3)
        assert all(plan.place in KINDS[name][1] for name in plan.mismatches)
        assert all(NEEDS.get(name, plan.telling) == plan.telling for name in plan.mismatches)
        assert plan.orbital == (plan.place not in LABORATORY)


def test_a_plan_is_of_its_seed_and_index_alone():
    assert planned(7, 3) == planned(7, 3)
    assert len({planned(seed, index) for seed in range(5) for index in range(20)}) > 60
