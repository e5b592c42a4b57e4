"""Bodies that can be."""

import numpy as np
import pytest

from baryscope.study.population.third.bodies import HULLS, drawn

BODIES = [drawn(np.random.default_rng(seed), (), 3.0) for seed in range(200)]


def test_every_hull_occurs():
    assert {body.hull for body in BODIES} == set(HULLS)


@pytest.mark.parametrize("body", BODIES[:40])
def test_an_inertia_is_one_of_positive_masses(body):
    moments = np.linalg.eigvalsh(body.inertia)
    assert np.trace(body.inertia) == pytest.approx(1)
    assert moments[0] > 0
    assert moments[2] < moments[0] + moments[1]


def test_features_are_on_the_hull_and_look_outwards():
    for body in BODIES:
        assert 3 <= len(body.points) <= 40
        np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1)
        assert body.half.max() <= 3
        if body.hull != "winged box":
            # Of a convex hull: no feature lies before the tangent plane of another.
            heights = np.einsum("ki,kmi->km", body.normals, body.points[None] - body.points[:, None])
            assert heights.max() < 1e-12
            assert not body.swing.any()


def test_wings_are_there_where_they_must_swing():
    body = drawn(np.random.default_rng(5), ("flexible wing",), 3.0)
    moving = body.swing.any(axis=1)
    assert body.hull == "winged box"
    assert moving.sum() >= 2
    assert np.abs(body.swing).max() <= 1
    assert (np.abs(body.swing[moving, 0]) == np.abs(body.swing[moving]).max(axis=1)).all()


def test_mismatches_that_take_features_away_leave_enough():
    assert min(len(drawn(np.random.default_rng(seed), ("glint",), 3.0).points) for seed in range(50)) >= 7
