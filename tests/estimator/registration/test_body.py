"""Bodies whose points move, against rotations by scipy, and where their features are."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.body import Body, places_of

RNG = np.random.default_rng(0)
POINTS = RNG.uniform(-2, 2, (5, 3)) + np.array([3.0, -1.0, 0.5])  # from a centre of mass beside them
ATTITUDE = Rotation.random(4, rng=1).as_matrix()
BODY = Body(np.array([0, 2, 3, 5, 6]), np.array([1, 2, 4, 7]), POINTS, ATTITUDE)


def test_points_that_all_turn_are_where_they_were():
    """The axes are attached to them: about the origin, wherever the centroid is."""
    turn = 1e-6 * np.array([1.0, -2.0, 3.0])
    np.testing.assert_allclose(BODY.moved(np.cross(turn, POINTS).ravel()).points, POINTS, rtol=0, atol=1e-10)


def test_a_shift_of_all_points_is_one_in_the_axes():
    shift = np.array([0.1, 0.2, -0.3])
    np.testing.assert_allclose(BODY.moved(np.tile(shift, 5)).points, POINTS + shift, rtol=0, atol=1e-14)


def test_points_that_move_anyhow_do_not_turn():
    change = 1e-5 * RNG.normal(size=15)
    moved = BODY.moved(change).points
    turned = Rotation.align_vectors(moved - moved.mean(axis=0), POINTS - POINTS.mean(axis=0))[0].magnitude()
    freely = POINTS + change.reshape(5, 3)
    first = Rotation.align_vectors(freely - freely.mean(axis=0), POINTS - POINTS.mean(axis=0))[0].magnitude()
    assert turned < 1e-9 < 1e-6 < first


def test_a_point_that_nothing_tells_does_not_turn_the_others():
    """It moves by ten times the body's length."""
    change, told = np.zeros((5, 3)), np.arange(5) != 3
    change[3] = [20.0, -30.0, 10.0]
    moved = BODY.moved(change.ravel(), told).points
    np.testing.assert_array_equal(moved[told], POINTS[told])
    np.testing.assert_array_equal(moved[3], POINTS[3] + change[3])


def test_features_are_where_the_origin_and_the_attitude_put_them():
    origin = RNG.normal(size=(9, 3))
    pairs = zip([1, 2, 4, 7], ATTITUDE, strict=True)
    expected = np.array([[origin[frame] + R @ point for point in POINTS] for frame, R in pairs])
    np.testing.assert_allclose(BODY.places(origin), expected, rtol=0, atol=1e-14)
    otherwise = RNG.normal(size=(9, 7, 3))
    found = places_of([BODY], origin, otherwise)
    np.testing.assert_allclose(found[np.ix_(BODY.frames, BODY.features)], expected, rtol=0, atol=1e-14)
    others = np.ones((9, 7), dtype=bool)
    others[np.ix_(BODY.frames, BODY.features)] = False
    np.testing.assert_array_equal(found[others], otherwise[others])


def test_what_two_bodies_share():
    other = Body(np.array([1, 2, 5]), np.zeros(0, dtype=int), np.zeros((3, 3)), np.zeros((0, 3, 3)))
    found = BODY.like(other)
    assert found.features.tolist() == [2, 5]
    np.testing.assert_array_equal(found.points, POINTS[[1, 3]])
