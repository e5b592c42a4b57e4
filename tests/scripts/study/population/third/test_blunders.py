"""Blunders are as many and as large as is said, and none is called right."""

import numpy as np
import pytest

from baryscope.study.population.third.blunders import Blunders, blundered, drawn
from baryscope.study.population.third.dice import rotation
from baryscope.study.population.third.sensor import Watch

FRAMES, LABELS, SIGMA = 400, 10, 0.01


def watch_of():
    rng = np.random.default_rng(1)
    path = np.tile([8.0, 1.0, 2.0], (FRAMES, 1))
    attitude = np.stack([rotation(rng) for _ in range(FRAMES)])
    ideal = path[:, None] + np.einsum("nij,mj->nmi", attitude, rng.normal(0, 1, (LABELS, 3)))
    seen = rng.random((FRAMES, LABELS)) < 0.8
    return Watch(ideal, np.zeros_like(ideal), attitude, path, np.ones(seen.shape), seen)


WATCH = watch_of()
ROOT = np.broadcast_to(SIGMA * np.eye(3), (FRAMES, LABELS, 3, 3))


def shifts(seed=2, **kinds):
    position, right = blundered(np.random.default_rng(seed), Blunders(**kinds), WATCH.ideal, ROOT, WATCH)
    return np.linalg.norm(position - WATCH.ideal, axis=2), right, position


def test_without_blunders_all_is_right():
    shift, right, _ = shifts()
    assert right.all()
    assert not shift.any()


@pytest.mark.parametrize(("kind", "low", "high"), [("near", 2 * SIGMA, 6 * SIGMA), ("gross", 0.3, 5)])
def test_outliers_are_as_many_and_as_far_as_is_said(kind, low, high):
    shift, right, _ = shifts(**{kind: 0.1})
    if kind == "gross":
        low, high = low * WATCH.spread, high * WATCH.spread
    bad = ~right
    assert bad.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / bad.size))
    assert (shift[bad] >= low * (1 - 1e-9)).all()
    assert (shift[bad] <= high * (1 + 1e-9)).all()
    assert not shift[right].any()


def test_swapped_labels_have_each_others_place():
    _, right, position = shifts(swapped=0.1)
    bad = ~right
    assert bad.sum() == pytest.approx(0.1 * WATCH.seen.sum(), abs=24)  # the last swap may be long
    assert WATCH.seen[bad].all()
    for frame in np.flatnonzero(bad.any(axis=1)):
        own, found = WATCH.ideal[frame, bad[frame]], position[frame, bad[frame]]
        assert not (own == found).all(axis=1).any()
        assert {tuple(row) for row in own.tolist()} == {tuple(row) for row in found.tolist()}


def test_a_sliding_point_creeps_by_what_is_said():
    shift, right, position = shifts(sliding=20.0)
    label = np.flatnonzero(~right.all(axis=0))
    assert len(label) == 1
    assert not right[:, label].any()
    in_body = np.einsum("nji,nj->ni", WATCH.attitude, (position - WATCH.ideal)[:, label[0]])
    np.testing.assert_allclose(np.linalg.norm(in_body[-1] - in_body[0]), 20 * SIGMA)
    np.testing.assert_allclose(np.diff(in_body, 2, axis=0), 0, atol=1e-12)
    assert not np.delete(shift, label, axis=1).any()


def test_a_highlight_stays_on_its_sphere_towards_the_chaser():
    _, right, position = shifts(glint=0.5, radius=0.4)
    frames, labels = np.nonzero(~right)
    assert len(set(labels.tolist())) == 1
    assert len(frames) == pytest.approx(0.5 * WATCH.seen[:, labels[0]].sum(), abs=1)
    places = position[frames, labels] - WATCH.path[frames]
    distance = np.linalg.norm(places, axis=1)
    assert (distance >= 0.7 * 0.4 - 1e-12).all()  # its centre is 0.3 radii from the centre of mass
    assert (distance <= 1.3 * 0.4 + 1e-12).all()
    assert np.median(places @ WATCH.path[0]) < 0


def test_only_blunders_that_are_named_are_drawn():
    assert drawn(np.random.default_rng(1), ("burns",), 1.0) == Blunders()
