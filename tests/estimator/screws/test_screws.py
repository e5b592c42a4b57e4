import numpy as np
import pytransform3d.transformations as pt
from scipy.spatial.transform import Rotation

from baryscope.estimator.screws.screws import TOO_LITTLE_ROTATION, screws_of_poses


def random_poses(n, seed):
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(2 * n, random_state=seed).as_matrix()
    centre = rng.normal(size=(2 * n, 3)) * 5
    return rotation[:n], centre[:n], rotation[n:], centre[n:]


def test_agrees_with_pytransform3d():
    R_1, c_1, R_2, c_2 = random_poses(100, seed=4)
    found = screws_of_poses(R_1, c_1, R_2, c_2)
    for k in range(100):
        R = R_2[k] @ R_1[k].T
        transform = pt.transform_from(R, c_2[k] - R @ c_1[k])
        coordinates = pt.exponential_coordinates_from_transform(transform)
        axis, angle = pt.screw_axis_from_exponential_coordinates(coordinates)
        point, direction, pitch = pt.screw_parameters_from_screw_axis(axis)
        np.testing.assert_allclose(found.axis[k], direction, atol=1e-9)
        np.testing.assert_allclose(found.angle[k], angle, atol=1e-9)
        np.testing.assert_allclose(found.translation[k], pitch * angle, atol=1e-7)
        np.testing.assert_allclose(np.cross(found.point[k] - point, direction), 0, atol=1e-6)
        # nearest the middle of the two centres
        middle = 0.5 * (c_1[k] + c_2[k])
        np.testing.assert_allclose(np.dot(found.point[k] - middle, direction), 0, atol=1e-9)


def test_accuracy_up_to_and_at_180_degrees():
    axis = np.array([2.0, -1, 2]) / 3
    angle = np.array([np.pi - 1e-6, np.pi - 1e-12, np.pi])
    pole = np.array([1.0, 2, 3])
    R = Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
    centre = np.array([4.0, -1, 0])
    moved = pole + R @ (centre - pole) + 0.7 * axis
    found = screws_of_poses(np.tile(np.eye(3), (3, 1, 1)), np.tile(centre, (3, 1)), R, moved)
    assert found.valid.all()
    np.testing.assert_allclose(np.abs(found.axis @ axis), 1, atol=1e-12)
    np.testing.assert_allclose(found.angle, angle, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.translation), 0.7, atol=1e-9)
    np.testing.assert_allclose(np.cross(found.point - pole, axis), 0, atol=1e-9)


def test_no_rotation_is_invalid():
    one = np.tile(np.eye(3), (2, 1, 1))
    found = screws_of_poses(one, np.zeros((2, 3)), one, np.ones((2, 3)))
    assert (found.status == TOO_LITTLE_ROTATION).all()
    assert np.isnan(found.axis).all()
    assert np.isnan(found.point).all()
