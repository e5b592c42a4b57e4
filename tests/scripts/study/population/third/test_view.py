"""Which features get labels when."""

import numpy as np
import pytest

from baryscope.study.population.third.view import ALL, FEWEST_SIGHTINGS, MOST_LABELS, PASSES, drawn

FRAMES, FEATURES = 200, 24
TURN = 2 * np.pi * np.linspace(0, 3, FRAMES)[:, None]
FACING = np.cos(TURN + 2 * np.pi * np.arange(FEATURES) / FEATURES)
LIGHT = np.zeros(FRAMES, dtype=bool)


@pytest.mark.parametrize("seed", range(30))
def test_what_is_seen_faces_the_chaser_and_is_no_rarity(seed):
    found = drawn(np.random.default_rng(seed), FACING, LIGHT, True)
    assert found.seen.shape == (FRAMES, len(found.feature))
    assert len(found.feature) <= MOST_LABELS
    assert found.seen.sum(axis=0).min() >= FEWEST_SIGHTINGS
    if found.how == ALL:
        return
    assert FACING[:, found.feature][found.seen].min() > np.cos(np.radians(85))
    assert len(set(found.feature.tolist())) == len(found.feature) or found.how == PASSES


def test_a_new_label_for_each_pass():
    """Three turns, so that a feature is in view in three or four stretches, each with one label."""
    kinds = [drawn(np.random.default_rng(seed), FACING, LIGHT, True) for seed in range(30)]
    passes = [found for found in kinds if found.how == PASSES]
    assert len(passes) >= 3
    for found in passes:
        most = np.bincount(found.feature).max()
        assert most in (3, 4)
        for label in range(len(found.feature)):
            when = np.flatnonzero(found.seen[:, label])
            assert FACING[when[0] : when[-1] + 1, found.feature[label]].min() > 0  # it does not turn away between


def test_nothing_is_seen_in_the_dark():
    dark = (np.arange(FRAMES) > 50) & (np.arange(FRAMES) < 90)
    for seed in range(10):
        found = drawn(np.random.default_rng(seed), FACING, dark, True)
        assert not found.seen[dark].any()
        assert found.seen[~dark].any()


def test_where_too_little_faces_the_chaser_all_is_seen():
    assert drawn(np.random.default_rng(1), -np.ones((50, 3)), LIGHT[:50], True).how == ALL
