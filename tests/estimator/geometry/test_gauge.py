"""Axes that are attached to points in a line."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.geometry.gauge import attached_turn, offset_by_points, turn_by_points

LINE = np.array([2.0, -1.0, 0.5]) + np.array([[-1.0], [0.2], [0.8]]) * [0.48, 0.6, 0.64]


def test_no_noise_turns_them_about_the_line():
    noisy = LINE + 1e-4 * np.random.default_rng(0).normal(size=LINE.shape)
    along = (LINE[2] - LINE[0]) / np.linalg.norm(LINE[2] - LINE[0])
    for points in (LINE, noisy, LINE[[0, 2]]):
        turn = turn_by_points(points)
        np.testing.assert_allclose(along @ turn, 0.0, atol=1e-3)
        across = np.array([0.1, 0.2, -0.3])
        across -= along * (along @ across)
        np.testing.assert_allclose(turn @ np.cross(across, points).ravel(), across, atol=1e-3)


def test_the_origin_stays_in_one_plane_with_the_line():
    """So that it moves along the line and away from it only, whatever the points do."""
    across = np.cross(LINE[2] - LINE[0], LINE.mean(axis=0))
    found = offset_by_points(LINE)
    np.testing.assert_allclose(across @ found, 0.0, atol=1e-12)
    np.testing.assert_allclose(found @ np.cross([0.1, 0.2, -0.3], LINE).ravel(), 0.0, atol=1e-12)
    np.testing.assert_allclose(found @ np.tile(LINE.mean(axis=0), 3), LINE.mean(axis=0), atol=1e-12)


def test_points_off_a_line_have_axes_of_their_own():
    off = LINE + np.diag([0.5, -0.5, 0.5])
    turn = [0.1, 0.2, -0.3]
    np.testing.assert_allclose(turn_by_points(off) @ np.cross(turn, off - off.mean(axis=0)).ravel(), turn, atol=1e-12)
    np.testing.assert_allclose(offset_by_points(off) @ np.tile(turn, 3), turn, atol=1e-12)


def _axes(points):
    """Axes (3, 3) along a line of points, and towards it from the origin."""
    along = np.linalg.svd(points - points.mean(axis=0))[2][0]
    along = along * np.sign(along @ (points[2] - points[0]))
    out = points.mean(axis=0) - along * (along @ points.mean(axis=0))
    out /= np.linalg.norm(out)
    return np.column_stack([along, out, np.cross(along, out)])


def test_axes_of_a_line_turn_about_it_with_the_origin():
    """As axes along the line and towards it do, by differences: errors across the plane turn them about the line."""
    step = 1e-6
    found, about = attached_turn(LINE), []
    for change in step * np.eye(9).reshape(9, 3, 3):
        turned = Rotation.from_matrix(_axes(LINE + change) @ _axes(LINE - change).T).as_rotvec()
        about.append(turned / (2 * step))
    np.testing.assert_allclose(found, np.transpose(about), atol=1e-6)
    assert np.abs(_axes(LINE)[:, 0] @ found).max() > 0.1
