"""Which features get labels when."""

import numpy as np

from baryscope.study.population.fourth.bodies import Body
from baryscope.study.population.fourth.views import FEWEST_FRAMES, drawn

TIME = np.linspace(0, 300, 200)
TURN = 2 * np.pi * TIME / 100
LOOK = np.column_stack([np.cos(TURN), np.sin(TURN), np.zeros(len(TIME))])  # three turns
CLUSTER = np.repeat([0, 1, 2], 4)
NORMALS = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
POINTS = np.random.default_rng(1).standard_normal((12, 3))
BODY = Body("box", 1.0, POINTS, CLUSTER, NORMALS)
VIEWS = [drawn(np.random.default_rng(seed), BODY, TIME, 300.0, LOOK) for seed in range(60)]


def test_what_is_seen_faces_the_chaser_and_is_enough():
    found = [view for view in VIEWS if view is not None]
    assert len(found) > 30
    for view in found:
        assert view.seen.shape == (len(TIME), len(view.feature)) == (len(TIME), len(view.labels))
        assert (view.seen.sum(axis=1) >= 3).sum() >= FEWEST_FRAMES
        assert view.seen.any(axis=0).all()
        assert len(set(view.labels)) == len(view.labels)
        facing = LOOK @ NORMALS[CLUSTER[view.feature]].T
        assert facing[view.seen].min() > np.cos(np.radians(110))


def test_new_labels_are_for_a_stretch_each():
    """No label comes back after its cluster turned away; one that is kept does."""
    relabelled = [view for view in VIEWS if view is not None and view.new_labels]
    assert len(relabelled) > 10
    for view in relabelled:
        for label, feature in enumerate(view.feature):
            if CLUSTER[feature] < 2:  # the third cluster never turns away
                when = np.flatnonzero(view.seen[:, label])
                assert when[-1] - when[0] < 0.7 * 100 / 300 * len(TIME)  # 220° of a turn
    kept = [view for view in VIEWS if view is not None and not view.new_labels]
    assert all(len(set(view.feature.tolist())) == len(view.feature) <= len(POINTS) for view in kept)


def test_without_normals_nothing_turns_away():
    body = Body("blob", 1.0, POINTS, CLUSTER, None)
    for seed in range(10):
        one, other = (drawn(np.random.default_rng(seed), body, TIME, 300.0, look) for look in (LOOK, -LOOK))
        np.testing.assert_array_equal(one.seen, other.seen)


def test_where_no_three_are_seen_there_is_no_view():
    away = np.broadcast_to([-1.0, 0, 0], (len(TIME), 3))
    hidden = Body("box", 1.0, POINTS, CLUSTER, np.tile([1.0, 0, 0], (3, 1)))
    assert drawn(np.random.default_rng(1), hidden, TIME, 300.0, away) is None
