import numpy as np

from baryscope.estimator.screws.intersection import intersect


def test_middle_and_length_of_the_shortest_segment():
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(2, 500, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    middle = rng.normal(size=(500, 3))
    normal = np.cross(axis[0], axis[1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    length = rng.uniform(0, 1, (500, 1))
    point_1 = middle + 0.5 * length * normal + rng.normal(size=(500, 1)) * axis[0]
    point_2 = middle - 0.5 * length * normal + rng.normal(size=(500, 1)) * axis[1]
    found = intersect(axis[0], point_1, axis[1], point_2, np.full(500, 1e-3))
    ok = found.valid
    assert ok.mean() > 0.99
    np.testing.assert_allclose(found.middle[ok], middle[ok], atol=1e-9)
    np.testing.assert_allclose(found.length[ok], length[ok, 0], atol=1e-9)
    np.testing.assert_allclose(found.sine, np.linalg.norm(np.cross(axis[0], axis[1]), axis=1))


def test_parallel_lines_are_invalid():
    axis = np.tile([0, 0, 1.0], (3, 1))
    other = np.array([[0, 0, 1.0], [0, 0, -1], [0.01, 0, np.sqrt(1 - 1e-4)]])
    found = intersect(axis, np.zeros((3, 3)), other, np.ones((3, 3)), np.array([0.0, 0.0, 0.02]))
    assert not found.valid.any()
    assert np.isnan(found.middle).all()
    assert np.isnan(found.length).all()
