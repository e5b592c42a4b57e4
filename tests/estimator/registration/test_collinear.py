"""Features in a line, from places along directions by scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.collinear import find_collinear

COUNT, NOISE = 300, 0.01
CENTRE = np.array([2.0, -15.0, 1.0])


def tracked(points, turn, noise=NOISE):
    """Positions (n, m, 3) of points of a body that turns about CENTRE."""
    exact = CENTRE + points @ np.swapaxes(turn.as_matrix(), 1, 2)
    return exact + noise * np.random.default_rng(1).normal(size=exact.shape)


@pytest.fixture
def tumbling():
    steps = np.arange(COUNT)
    return Rotation.from_rotvec(np.outer(0.02 * steps, [0, 1.0, 0])) * Rotation.from_rotvec(
        np.outer(0.05 * steps, [0.6, 0, 0.8])
    )


def test_two_features_are_a_direction_and_a_place(tumbling):
    points = np.array([[0.5, 0.3, -0.2], [-0.3, 0.9, 0.1]])
    found = find_collinear(tracked(points, tumbling), np.ones((COUNT, 2), dtype=bool))
    (body,), (origin,) = found.bodies, found.origins
    assert body.in_line
    assert found.in_line
    apart = points[1] - points[0]
    length = np.linalg.norm(apart)
    assert np.ptp(body.points[:, 2]) == pytest.approx(length, abs=4 * NOISE / np.sqrt(COUNT))
    np.testing.assert_array_equal(body.points[:, :2], 0.0)
    direction = tumbling.apply(apart / length)
    sign = np.sign(body.points[1, 2])
    np.testing.assert_allclose(sign * body.attitude[:, :, 2], direction, atol=6 * NOISE / length)
    np.testing.assert_allclose(
        body.attitude @ np.swapaxes(body.attitude, 1, 2), np.tile(np.eye(3), (COUNT, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(origin, CENTRE + tumbling.apply(points.mean(axis=0)), atol=6 * NOISE)
    assert found.noise == pytest.approx(NOISE, rel=0.1)


def test_what_is_on_the_line_joins_and_what_is_not_does_not(tumbling):
    """Of five features four are on a line; the frames that do not show these are left out."""
    along = np.array([0.48, 0.6, 0.64])
    places = np.array([0.0, 0.4, 0.7, 1.5])
    points = np.concatenate([[0.2, -0.5, 0.3] + places[:, None] * along, [[0.4, -0.1, 0.4]]])
    used = np.ones((COUNT, 5), dtype=bool)
    used[::3, 2] = False
    used[::7, [0, 1, 2]] = False
    found = find_collinear(tracked(points, tumbling), used)
    body = found.bodies[0]
    np.testing.assert_array_equal(body.features, [0, 1, 2, 3])
    np.testing.assert_array_equal(body.frames, np.setdiff1d(np.arange(COUNT), np.arange(0, COUNT, 7)))
    between = np.abs(np.diff(body.points[:, 2]))
    np.testing.assert_allclose(between, np.diff(places), atol=0.005)


def test_of_pairs_the_one_that_tells_most_is_taken(tumbling):
    """Two that are close together are seen in all frames, a third far away in two thirds of them."""
    points = np.array([[0.5, 0.3, -0.2], [0.52, 0.3, -0.2], [-0.5, 0.9, 0.4]])
    used = np.ones((COUNT, 3), dtype=bool)
    used[::3, 2] = False
    found = find_collinear(tracked(points, tumbling), used)
    assert len(found.bodies) == 1
    assert 2 in found.bodies[0].features
    assert len(found.bodies[0].frames) == np.count_nonzero(used[:, 2])


def test_features_that_are_never_seen_together_are_no_rod(tumbling):
    used = np.zeros((COUNT, 2), dtype=bool)
    used[::2, 0] = used[1::2, 1] = True
    assert find_collinear(tracked(np.eye(3)[:2], tumbling), used) is None
