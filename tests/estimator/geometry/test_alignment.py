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
def test_same_as_scipy(m, flat, noise):
    points_A, points_B, _ = noisy_sets(200, m, flat=flat, noise=noise, seed=m)
    weights = np.random.default_rng(m).uniform(0.2, 3, (200, m))
    aligned = align(points_A, points_B, weights)
    for k in range(200):
        a = points_A[k] - np.average(points_A[k], axis=0, weights=weights[k])
        b = points_B[k] - np.average(points_B[k], axis=0, weights=weights[k])
        expected = Rotation.align_vectors(a, b, weights[k])[0].as_matrix()
        # 1e-8: both lose digits as the square of condition where the points nearly lie in a line.
        np.testing.assert_allclose(aligned.rotation[k], expected, atol=1e-8)


def test_three_noisy_coplanar_features_are_never_reflected():
    points_A, points_B, R_A_B = noisy_sets(2000, 3, flat=False, noise=0.02, seed=1)
    centred_A, centred_B = (points - points.mean(axis=1, keepdims=True) for points in (points_A, points_B))
    u, _, vt = np.linalg.svd(np.swapaxes(centred_A, 1, 2) @ centred_B)
    reflected = np.linalg.det(u @ vt) < 0
    # The third singular value is rounding: a coin, so that 2000 throws lie within ±5 sd = ±0.056 of one half.
    assert abs(reflected.mean() - 0.5) < 0.056
    aligned = align(points_A, points_B, np.ones((2000, 3)))
    np.testing.assert_allclose(np.linalg.det(aligned.rotation), 1.0, atol=1e-12)
    turned_off = Rotation.from_matrix(aligned.rotation @ np.swapaxes(R_A_B, 1, 2)).magnitude()
    assert np.median(turned_off) < 0.05


@given(st.integers(0, 2**32 - 1), st.integers(3, 10), st.booleans())
def test_rigid_motion_is_found_exactly_whatever_is_missing(seed, m, flat):
    points_A, points_B, R_A_B = noisy_sets(20, m, flat=flat, noise=0.0, seed=seed)
    weights = np.random.default_rng(seed).integers(0, 2, (20, m)).astype(float)
    weights[:, :3] = 1.0
    points_A[weights == 0] = np.nan
    aligned = align(points_A, points_B, weights)
    clear = aligned.spread > 1e-3
    np.testing.assert_allclose(aligned.rotation[clear], R_A_B[clear], atol=1e-7)
    carried = np.einsum("nij,nmj->nmi", aligned.rotation, points_B) + aligned.translation[:, None]
    off = np.where(weights[..., None] > 0, carried - np.nan_to_num(points_A), 0)
    np.testing.assert_allclose(off[clear], 0, atol=1e-6)


def test_points_in_a_line_have_no_spread():
    direction = np.array([1.0, 2.0, -1.0])
    line = (np.arange(4.0)[:, None] * direction)[None]
    aligned = align(line, line, np.ones((1, 4)))
    assert aligned.spread[0] < 1e-9
    np.testing.assert_allclose(np.linalg.det(aligned.rotation), 1.0)
    quaternion, spread = rotation_from_moments(np.zeros((1, 3, 3)))
    np.testing.assert_array_equal(np.abs(quaternion), [[1, 0, 0, 0]])
    assert spread[0] == 0


def test_spread_is_a_bound_within_a_factor_of_five_of_the_singular_values():
    moments = np.random.default_rng(0).normal(size=(5000, 3, 3))
    u, s, vt = np.linalg.svd(moments)
    exact = s[:, 1] + np.sign(np.linalg.det(u @ vt)) * s[:, 2]
    _, spread = rotation_from_moments(moments)
    assert (spread <= exact * (1 + 1e-6)).all()
    assert (spread >= exact / 5).all()


@given(st.integers(0, 2**32 - 1))
def test_quaternions_and_matrices_go_together_as_in_scipy(seed):
    rotation = Rotation.random(30, random_state=seed)
    quaternion = np.roll(rotation.as_quat(), 1, axis=1)
    np.testing.assert_allclose(matrix_from_quaternion(quaternion), rotation.as_matrix(), atol=1e-14)
    back = quaternion_from_matrix(rotation.as_matrix())
    np.testing.assert_allclose(np.abs(np.sum(back * quaternion, axis=1)), 1.0, atol=1e-14)
