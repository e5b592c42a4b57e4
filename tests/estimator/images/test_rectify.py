"""Rectification and triangulation, beside a pinhole with distortion that is written out here."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.lens import Lens, RightLens
from baryscope.estimator.camera.pair import CameraPair
from baryscope.estimator.images.rectify import Rectified

pytest.importorskip("cv2", reason="OpenCV, the extra images, is not installed")

PLACE = np.array([0.3, 0.01, 0.02])
TURN = Rotation.from_rotvec([0.01, -0.05, 0.004])
SIZE = (640, 480)


def seen(lens, point):
    """Pixels (k, 2) of points (k, 3): Brown's model, with k1, k2, p1, p2, k3 as OpenCV documents it."""
    x, y = (point[:, :2] / point[:, 2:]).T
    k1, k2, p1, p2, k3 = lens.distortion
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.stack([u, v], axis=1) * lens.focal_length + lens.principal_point


@pytest.fixture(scope="module")
def pair():
    x, y, z, w = TURN.as_quat()
    left = Lens(
        focal_length=(900.0, 905.0), principal_point=(310.0, 250.0), resolution=SIZE,
        distortion=(-0.2, 0.05, 1e-3, -5e-4, 0.01),
    )  # fmt: skip
    right = RightLens(
        focal_length=(910.0, 908.0), principal_point=(325.0, 236.0), resolution=SIZE,
        distortion=(-0.18, 0.04, -1e-3, 2e-4, 0.0), position=tuple(PLACE.tolist()), mounting=(w, x, y, z),
    )  # fmt: skip
    return CameraPair(left, right)


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(-0.6, 0.9, 60), rng.uniform(-0.6, 0.6, 60), rng.uniform(3.5, 5, 60)])


def rectified_pixels(found, points):
    """u and v in the left image and u in the right, by the definition of a rectified pair."""
    x, y, z = (points @ found.R_left_V).T
    u, v = found.focal_length * x / z, found.focal_length * y / z
    centre = found.principal_point
    right = found.focal_length * (x - found.baseline) / z + centre[0] + found.shift
    return np.column_stack([u + centre[0], v + centre[1], right])


def test_the_maps_lead_to_the_pixels_of_the_lenses(pair, points):
    """To the maps' rounding, and to what distortion bends between two of their pixels."""
    found = Rectified.of(pair)
    assert found.baseline == pytest.approx(np.linalg.norm(PLACE), rel=1e-12)
    u, v, right = rectified_pixels(found, points).T
    in_right = (points - PLACE) @ TURN.as_matrix()
    for lens, where, own, column in (
        (pair.left, found.maps[0], points, u),
        (pair.right, found.maps[1], in_right, right),
    ):
        inside = (column > 0) & (column < SIZE[0] - 1) & (v > 0) & (v < SIZE[1] - 1)
        assert inside.sum() > 40
        raw = [map_coordinates(part, [v, column], order=1) for part in where[::-1]]
        np.testing.assert_allclose(np.stack(raw, axis=1)[inside], seen(lens, own)[inside], atol=2e-4)


def test_points_are_triangulated_in_the_left_cameras_axes(pair, points):
    found = Rectified.of(pair)
    pixels = rectified_pixels(found, points)
    noise = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.01]])
    place, covariance = found.points(pixels, np.tile(noise, (len(points), 1, 1)))
    np.testing.assert_allclose(place, points, rtol=1e-12)
    step = 1e-4
    moved = [found.points(pixels + step * axis, np.zeros((len(points), 3, 3)))[0] for axis in np.eye(3)]
    J = np.stack(moved, axis=-1) / step - points[..., None] / step
    np.testing.assert_allclose(covariance, J @ noise @ np.swapaxes(J, 1, 2), rtol=1e-4)  # of a difference quotient
