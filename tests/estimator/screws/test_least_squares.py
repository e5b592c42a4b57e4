import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.screws.least_squares import least_squares_screws
from baryscope.estimator.screws.screws import TOO_FEW_POINTS, screws_of_poses


def noisy_pairs(n, m, *, noise, seed, angles):
    rng = np.random.default_rng(seed)
    before = rng.normal(size=(n, m, 3)) * 3
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    R = Rotation.from_rotvec(axis * np.resize(angles, n)[:, None]).as_matrix()
    pole = 5 * rng.normal(size=(n, 1, 3))
    after = pole + np.einsum("nij,nmj->nmi", R, before - pole) + 0.3 * axis[:, None]
    before, after = (p + 20.0 + noise * rng.normal(size=p.shape) for p in (before, after))
    return before, after


def closed_form(before, after, weights):
    """Kabsch by scipy, one pair after the other, and the screw of that pose."""
    n = len(before)
    R, c_1, c_2 = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    for k in range(n):
        c_1[k], c_2[k] = (np.average(p[k], axis=0, weights=weights[k]) for p in (before, after))
        R[k] = Rotation.align_vectors(after[k] - c_2[k], before[k] - c_1[k], weights[k])[0].as_matrix()
    return screws_of_poses(np.tile(np.eye(3), (n, 1, 1)), c_1, R, c_2)


@pytest.mark.parametrize("m, noise", [(3, 0.02), (4, 0.0), (8, 0.05), (10, 0.5)])
def test_agrees_with_the_closed_form_of_the_pose(m, noise):
    before, after = noisy_pairs(300, m, noise=noise, seed=m, angles=[0.3, 0.8, 1.5, 2.5, 3.0])
    weights = np.random.default_rng(m).uniform(0.5, 2, (300, m))
    found, expected = least_squares_screws(before, after, weights), closed_form(before, after, weights)
    assert found.valid.mean() > 0.99
    ok = found.valid
    np.testing.assert_allclose(found.angle[ok], expected.angle[ok], atol=1e-6)
    np.testing.assert_allclose(found.axis[ok], expected.axis[ok], atol=1e-6)
    np.testing.assert_allclose(found.point[ok], expected.point[ok], atol=1e-5)
    np.testing.assert_allclose(found.translation[ok], expected.translation[ok], atol=1e-5)


def test_missing_points_are_ignored_and_two_are_too_few():
    before, after = noisy_pairs(40, 6, noise=0.02, seed=1, angles=[1.0])
    weights = np.ones((40, 6))
    weights[:, 4:] = 0
    weights[0, 2:] = 0
    found = least_squares_screws(
        np.where(weights[..., None] > 0, before, np.nan), np.where(weights[..., None] > 0, after, np.nan), weights
    )
    expected = closed_form(before[:, :4], after[:, :4], np.ones((40, 4)))
    assert found.status[0] == TOO_FEW_POINTS
    assert found.valid[1:].all()
    np.testing.assert_allclose(found.axis[1:], expected.axis[1:], atol=1e-6)


def test_pairs_solved_together_or_alone_agree():
    before, after = noisy_pairs(3000, 4, noise=0.02, seed=2, angles=[0.5, 1.0])
    together = least_squares_screws(before, after, np.ones((3000, 4)))
    alone = least_squares_screws(before[2999:], after[2999:], np.ones((1, 4)))
    np.testing.assert_allclose(alone.axis[0], together.axis[2999], atol=1e-8)


def test_half_a_turn_and_no_turn():
    before, after = noisy_pairs(50, 5, noise=0.0, seed=3, angles=[np.pi])
    found, expected = (f(before, after, np.ones((50, 5))) for f in (least_squares_screws, closed_form))
    ok = found.valid
    assert ok.mean() > 0.9
    np.testing.assert_allclose(np.abs(np.sum(found.axis * expected.axis, axis=1))[ok], 1.0, atol=1e-9)
    still = least_squares_screws(before, before + 1.0, np.ones((50, 5)))
    assert not still.valid.any()
