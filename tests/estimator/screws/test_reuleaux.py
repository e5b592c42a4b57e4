import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.screws.reuleaux import reuleaux
from baryscope.estimator.screws.screws import (
    DEGENERATE_POINTS,
    SOUND,
    TOO_FEW_POINTS,
    TOO_LITTLE_ROTATION,
    screws_of_poses,
)


def displaced(points, axis, angle, pole, shift):
    """Points after a screw, by scipy's rotation."""
    R = Rotation.from_rotvec(angle * axis).as_matrix()
    return pole + (points - pole) @ R.T + shift * axis


@given(
    st.integers(0, 2**32 - 1),
    st.integers(3, 8),
    st.sampled_from([0.05, 0.5, np.pi / 2, 3.0, np.pi - 1e-7]),
)
def test_the_screw_of_an_exact_displacement(seed, m, angle):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    pole, points = 3 * rng.normal(size=3), rng.normal(size=(m, 3))
    after = displaced(points, axis, angle, pole, 0.3)
    found = reuleaux(points[None], after[None], np.ones((1, m)), deviation=1e-3)
    if not found.valid[0]:  # nearly degenerate by chance
        return
    np.testing.assert_allclose(found.axis[0], axis, atol=1e-6)
    np.testing.assert_allclose(found.angle[0], angle, atol=1e-6)
    np.testing.assert_allclose(found.translation[0], 0.3, atol=1e-5)
    np.testing.assert_allclose(np.cross(found.point[0] - pole, axis), 0, atol=1e-4)
    middle = 0.5 * (points.mean(axis=0) + after.mean(axis=0))
    np.testing.assert_allclose(np.dot(found.point[0] - middle, axis), 0, atol=1e-9)


def test_most_random_triangles_are_valid():
    rng = np.random.default_rng(0)
    before = rng.normal(size=(2000, 3, 3))
    after = np.array([displaced(p, np.array([0, 0, 1.0]), 1.0, np.ones(3), 0.1) for p in before])
    found = reuleaux(before, after, np.ones((2000, 3)), deviation=1e-3)
    assert found.valid.mean() > 0.98
    np.testing.assert_allclose(found.axis[found.valid], [[0, 0, 1]] * found.valid.sum(), atol=1e-6)


def test_at_180_degrees_only_the_sense_is_undetermined():
    axis, pole = np.array([0.6, 0, 0.8]), np.array([1.0, 2, 3])
    points = np.random.default_rng(1).normal(size=(5, 3))
    found = reuleaux(points[None], displaced(points, axis, np.pi, pole, 0.2)[None], np.ones((1, 5)))
    assert found.angle[0] == pytest.approx(np.pi)
    assert abs(found.axis[0] @ axis) == pytest.approx(1)
    assert found.translation[0] == pytest.approx(0.2 * (found.axis[0] @ axis))


def test_the_axis_takes_the_sense_of_the_rotation():
    points = np.random.default_rng(2).normal(size=(4, 3))
    z = np.array([0, 0, 1.0])
    for sign in (1, -1):
        found = reuleaux(points[None], displaced(points, sign * z, 1.0, 0 * z, 0.0)[None], np.ones((1, 4)))
        np.testing.assert_allclose(found.axis[0], sign * z, atol=1e-12)


TRIANGLE = np.array([[1.0, 0, 0], [0, 1, 0], [-1, -1, 0.5]])
Z = np.array([0, 0, 1.0])
DEGENERATE = {
    "no motion": (TRIANGLE, 0.0, 0.0, TOO_LITTLE_ROTATION),
    "a shift only": (TRIANGLE, 0.0, 1.0, TOO_LITTLE_ROTATION),
    "points in a line": (np.outer([0, 1, 2.0], [1, 1, 0]), 1.0, 0.0, DEGENERATE_POINTS),
    "the axis in the points' plane": (np.array([[0, 0, 0], [1, 0, 0], [0.3, 0, 2]]), 1.0, 0.0, DEGENERATE_POINTS),
    "all points on the axis": (np.outer([0, 1, 2.0], Z), 1.0, 0.0, TOO_LITTLE_ROTATION),
}


@pytest.mark.parametrize("case", DEGENERATE)
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_degenerate_displacements_are_invalid(case, noise):
    points, angle, shift, status = DEGENERATE[case]
    rng = np.random.default_rng(3)
    before = np.tile(points, (100, 1, 1))
    after = np.tile(displaced(points, Z, angle, np.zeros(3), shift), (100, 1, 1))
    before, after = (p + noise * rng.normal(size=p.shape) for p in (before, after))
    found = reuleaux(before, after, np.ones((100, 3)), deviation=noise)
    # Noise may tip a few of a hundred over three deviations.
    assert (found.status == status).mean() >= (1.0 if noise == 0 else 0.9)
    assert np.isnan(found.point[~found.valid]).all()
    assert found.valid.mean() <= (0.0 if noise == 0 else 0.03)


def test_missing_points_are_ignored_and_two_are_too_few():
    points = np.random.default_rng(8).normal(size=(5, 3))
    after = displaced(points, Z, 1.0, np.ones(3), 0.5)
    weights = np.array([[1.0, 1, 1, 0, 0], [1, 1, 0, 0, 0], [1, 1, 1, 1, 1]])
    before, after = (np.where(weights[..., None] > 0, p, np.nan) for p in (points, after))
    found = reuleaux(before, after, weights)
    np.testing.assert_array_equal(found.status, [SOUND, TOO_FEW_POINTS, SOUND])
    np.testing.assert_allclose(found.axis[[0, 2]], [Z, Z], atol=1e-12)


def test_noise_of_angle_axis_and_position_follows_the_laws():
    """σ_φ = σ √(3/(nρ²)) for the turn, σ_φ / (2 sin(θ/2)) for the axis, σ √(2/n) / (2 sin(θ/2)) for its place.

    The laws of docs/theory/screws.md, for two noisy clouds. The points are isotropic: the corners of an octahedron of
    radius 1. The laws are the pose's. The rule (8) sees only what the displacements do along the axis: its axis is √2
    noisier, as linearising it shows, also when it takes all points.
    """
    points = np.vstack([np.eye(3), -np.eye(3)])
    n, sigma, angle, trials = 6, 0.005, 1.2, 20000
    rng = np.random.default_rng(6)
    before = np.tile(points, (trials, 1, 1))
    after = np.tile(displaced(points, Z, angle, np.zeros(3), 0.0), (trials, 1, 1))
    before, after = (p + sigma * rng.normal(size=p.shape) for p in (before, after))
    turn, chord = sigma * np.sqrt(3 / n), 2 * np.sin(angle / 2)
    rule = reuleaux(before, after, np.ones((trials, n)), deviation=sigma)
    aligned = align(after, before, np.ones((trials, n)))
    one = np.tile(np.eye(3), (trials, 1, 1))
    pose = screws_of_poses(one, aligned.centroid_b, aligned.rotation, aligned.centroid_a)
    assert rule.valid.all()
    # 20000 samples: the sd of a standard deviation is 0.5 %; 3 % leaves room for the terms of second order.
    for found, loss in ((rule, np.sqrt(2)), (pose, 1.0)):
        assert found.angle.std() == pytest.approx(turn, rel=0.03)
        np.testing.assert_allclose(found.axis[:, :2].std(axis=0), loss * turn / chord, rtol=0.03)
    np.testing.assert_allclose(pose.point[:, :2].std(axis=0), sigma * np.sqrt(2 / n) / chord, rtol=0.03)
    assert (rule.point[:, :2].std(axis=0) > 0.97 * sigma * np.sqrt(2 / n) / chord).all()
