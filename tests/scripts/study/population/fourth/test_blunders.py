"""Blunders of every kind: as many as asked, of the size that is said, and none of them right."""

import numpy as np
import pytest

from baryscope.study.population.fourth.blunders import BURSTS, KINDS, SWAPPED, Scene, blundered

SIZE, NOISE, SHARE = 2.0, 0.01, 0.1


def scene_of():
    rng = np.random.default_rng(1)
    ideal = np.array([20.0, 5.0, 1.0]) + rng.standard_normal((300, 8, 3))
    noisy = ideal + NOISE * rng.standard_normal(ideal.shape)
    return Scene(ideal, noisy, rng.random((300, 8)) < 0.8, np.array([0, 1, 2, 3, 4, 5, 6, 0]), SIZE, NOISE)


SCENE = scene_of()


@pytest.mark.parametrize("kind", KINDS)
def test_a_share_of_what_is_seen_is_something_else(kind):
    position, right = blundered(np.random.default_rng(2), SCENE, kind, SHARE)
    wrong = SCENE.seen & ~right
    assert not (right & ~SCENE.seen).any()
    # four deviations; bursts end with the one that fills the share, a swap with the same feature is none
    assert wrong.sum() / SCENE.seen.sum() == pytest.approx(SHARE, abs=4 * np.sqrt(SHARE / SCENE.seen.sum()))
    assert (position != SCENE.noisy).any(axis=2)[wrong].all()
    np.testing.assert_array_equal(position[~wrong], SCENE.noisy[~wrong])


def shift_of(kind):
    position, right = blundered(np.random.default_rng(2), SCENE, kind, SHARE)
    wrong = SCENE.seen & ~right
    return (position - SCENE.noisy)[wrong], wrong


@pytest.mark.parametrize(
    ("kind", "least", "greatest"),
    [
        ("gross", 0.3 * SIZE, 2 * SIZE),
        ("deep", 0.3 * SIZE, 3 * SIZE),
        ("near", 4 * NOISE, 15 * NOISE),
        (BURSTS, 0.2 * SIZE, SIZE),
    ],
)
def test_shifts_are_of_their_size(kind, least, greatest):
    length = np.linalg.norm(shift_of(kind)[0], axis=1)
    assert least <= length.min() * (1 + 1e-9)
    assert length.max() <= greatest * (1 + 1e-9)


def test_deep_ones_are_along_the_ray():
    shift, wrong = shift_of("deep")
    np.testing.assert_allclose(np.cross(shift, SCENE.ideal[wrong]), 0, atol=1e-10)


def test_those_of_bursts_are_the_same_for_a_label():
    shift, wrong = shift_of(BURSTS)
    labels = np.nonzero(wrong)[1]
    for label in set(labels.tolist()):
        same = shift[labels == label]
        np.testing.assert_allclose(same, np.broadcast_to(same[0], same.shape), atol=1e-12)


def test_swapped_ones_are_at_another_feature_that_is_seen():
    shift, wrong = shift_of(SWAPPED)
    for (frame, label), by in zip(np.argwhere(wrong), shift, strict=True):
        off = np.linalg.norm(SCENE.ideal[frame] - SCENE.ideal[frame, label] - by, axis=1)
        other = int(off.argmin())
        assert off[other] < 1e-12
        assert SCENE.seen[frame, other]
        assert SCENE.feature[other] != SCENE.feature[label]


def test_without_blunders_all_that_is_seen_is_right():
    position, right = blundered(np.random.default_rng(2), SCENE, "", 0.0)
    np.testing.assert_array_equal(right, SCENE.seen)
    np.testing.assert_array_equal(position, SCENE.noisy)
