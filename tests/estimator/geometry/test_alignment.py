import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from baryscope.estimator.geometry.alignment import (
    align,
    matrix_from_quaternion,
    quaternion_from_matrix,
    rotation_from_moments,
)


def noisy_sets(n, m, *, flat, noise, seed):
    rng = np.random.default_rng(seed)
    points_B = rng.normal(size=(n, m, 3)) * ([1, 1, 0] if flat else [1, 1, 1])
    R_A_B = Rotation.random(n, random_state=seed).as_matrix()
    points_A = np.einsum("nij,nmj->nmi", R_A_B, points_B) + rng.normal(size=(n, 1, 3)) * 10
    return points_A + noise * rng.normal(size=points_A.shape), points_B, R_A_B


@pytest.mark.parametrize("m, flat, noise", [(3, False, 0.05), (4, True, 0.3), (8, False, 1.0), (8, True, 1e-6)])
def test_rotation_agrees_with_scipy(m, flat, noise):
    points_A, points_B, _ = noisy_sets(200, m, flat=flat, noise=noise, seed=m)
    weights = np.random.default_rng(m).uniform(0.2, 3, (200, m))
    aligned = align(points_A, points_B, weights)
    for k in range(200):
        a = points_A[k] - np.average(points_A[k], axis=0, weights=weights[k])
        b = points_B[k] - np.average(points_B[k], axis=0, weights=weights[k])
        expected = Rotation.align_vectors(a, b, weights[k])[0].as_matrix()
        # 1e-8: the error of both grows with the square of the condition number for nearly collinear points.
        np.testing.assert_allclose(aligned.rotation[k], expected, atol=1e-8)


def test_three_noisy_coplanar_features_are_never_reflected():
    points_A, points_B, R_A_B = noisy_sets(2000, 3, flat=False, noise=0.02, seed=1)
    centred_A, centred_B = (points - points.mean(axis=1, keepdims=True) for points in (points_A, points_B))
    u, _, vt = np.linalg.svd(np.swapaxes(centred_A, 1, 2) @ centred_B)
    reflected = np.linalg.det(u @ vt) < 0
    # The sign of the third singular value is rounding: binomial with p = 1/2, 5 sd of 2000 draws are 0.056.
    assert abs(reflected.mean() - 0.5) < 0.056
    aligned = align(points_A, points_B, np.ones((2000, 3)))
    np.testing.assert_allclose(np.linalg.det(aligned.rotation), 1.0, atol=1e-12)
    attitude_error = Rotation.from_matrix(aligned.rotation @ np.swapaxes(R_A_B, 1, 2)).magnitude()
    assert np.median(attitude_error) < 0.05


@given(st.integers(0, 2**32 - 1), st.integers(3, 10), st.booleans())
def test_rigid_motion_is_exact_with_missing_points(seed, m, flat):
    points_A, points_B, R_A_B = noisy_sets(20, m, flat=flat, noise=0.0, seed=seed)
    weights = np.random.default_rng(seed).integers(0, 2, (20, m)).astype(float)
    weights[:, :3] = 1.0
    points_A[weights == 0] = np.nan
    aligned = align(points_A, points_B, weights)
    determined = aligned.spread > 1e-3
    np.testing.assert_allclose(aligned.rotation[determined], R_A_B[determined], atol=1e-7)
    moved = np.einsum("nij,nmj->nmi", aligned.rotation, points_B) + aligned.translation[:, None]
    residual = np.where(weights[..., None] > 0, moved - np.nan_to_num(points_A), 0)
    np.testing.assert_allclose(residual[determined], 0, atol=1e-6)


def test_collinear_points_have_zero_spread():
    direction = np.array([1.0, 2.0, -1.0])
    line = (np.arange(4.0)[:, None] * direction)[None]
    aligned = align(line, line, np.ones((1, 4)))
    assert aligned.spread[0] < 1e-9
    np.testing.assert_allclose(np.linalg.det(aligned.rotation), 1.0)
    quaternion, spread = rotation_from_moments(np.zeros((1, 3, 3)))
    np.testing.assert_array_equal(np.abs(quaternion), [[1, 0, 0, 0]])
    assert spread[0] == 0


def test_spread_is_a_lower_bound_within_a_factor_of_five():
    moments = np.random.default_rng(0).normal(size=(5000, 3, 3))
    u, s, vt = np.linalg.svd(moments)
    exact = s[:, 1] + np.sign(np.linalg.det(u @ vt)) * s[:, 2]
    _, spread = rotation_from_moments(moments)
    assert (spread <= exact * (1 + 1e-6)).all()
    assert (spread >= exact / 5).all()


@given(st.integers(0, 2**32 - 1))
def test_quaternion_matrix_conversions_agree_with_scipy(seed):
    rotation = Rotation.random(30, random_state=seed)
    quaternion = np.roll(rotation.as_quat(), 1, axis=1)
    np.testing.assert_allclose(matrix_from_quaternion(quaternion), rotation.as_matrix(), atol=1e-14)
    back = quaternion_from_matrix(rotation.as_matrix())
    np.testing.assert_allclose(np.abs(np.sum(back * quaternion, axis=1)), 1.0, atol=1e-14)
