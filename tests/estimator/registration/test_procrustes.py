import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.procrustes import MAX_ROUNDS, register


def motion(n, m, *, noise, seed, flat=False):
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=(m, 3)) * ([2, 2, 0] if flat else [2, 2, 2])
    R_C_B = Rotation.random(n, random_state=seed).as_matrix()
    shift = 10 * rng.normal(size=(n, 3))
    points = np.einsum("nij,mj->nmi", R_C_B, shape) + shift[:, None]
    return points + noise * rng.normal(size=points.shape), R_C_B, shape


@pytest.mark.parametrize("reference", ["mean", "first"])
@pytest.mark.parametrize("m, flat", [(3, False), (4, True), (8, False)])
def test_exact_motion_is_registered_exactly(reference, m, flat):
    points, R_C_B, shape = motion(200, m, noise=0.0, seed=m, flat=flat)
    found = register(points, reference)
    np.testing.assert_allclose(found.rigid_points, points, atol=1e-9)
    np.testing.assert_allclose(found.rotation, R_C_B @ R_C_B[0].T, atol=1e-9)
    np.testing.assert_allclose(found.translation, points.mean(axis=1), atol=1e-9)
    assert found.converged
    assert found.valid.all()
    assert found.rms < 1e-9
    assert found.radius == pytest.approx(np.sqrt(((shape - shape.mean(axis=0)) ** 2).sum() / m))


@pytest.mark.parametrize("reference", ["mean", "first"])
def test_missing_points_and_late_features_are_merged(reference):
    points, R_C_B, _ = motion(300, 6, noise=0.0, seed=7)
    complete = points.copy()
    rng = np.random.default_rng(3)
    points[rng.random((300, 6)) < 0.2] = np.nan
    points[:, :3] = complete[:, :3]
    points[:100, 4] = points[200:, 5] = np.nan
    found = register(points, reference)
    np.testing.assert_allclose(found.rigid_points, complete, atol=1e-8)
    np.testing.assert_allclose(found.rotation, R_C_B @ R_C_B[0].T, atol=1e-8)


def test_rms_is_the_noise_and_the_mean_shape_is_better_than_the_first_frame():
    points, R_C_B, _ = motion(1000, 5, noise=0.02, seed=11)
    found = {reference: register(points, reference) for reference in ("mean", "first")}
    # 1000 × 5 × 3 coordinates less 6015 unknowns: the relative sd of the estimate is 1/√(2 · 8991) = 0.75 %.
    assert found["mean"].rms == pytest.approx(0.02, rel=0.03)
    deviation = {}
    for name, registration in found.items():
        attitude_error = Rotation.from_matrix(np.swapaxes(R_C_B, 1, 2) @ registration.rotation)
        deviation[name] = (attitude_error * attitude_error.mean().inv()).magnitude()
    # All three directions together: √3 σ_φ; the wide margin is for the anisotropic shape.
    assert np.sqrt(np.mean(deviation["mean"] ** 2)) == pytest.approx(
        np.sqrt(3) * found["mean"].angle_deviation, rel=0.25
    )
    assert found["first"].rms > found["mean"].rms


def test_iterations_converge_and_are_counted():
    points, _, _ = motion(500, 8, noise=0.05, seed=2)
    assert register(points, "first").rounds == 1
    assert 2 <= register(points, "mean").rounds <= 20


def test_a_slow_iteration_counts_as_converged_once_noise_hides_the_rest():
    """Two halves of the frames share two features only: the iteration is still under way after its last round."""
    for noise, converged in ((0.02, True), (0.0, False)):
        points, _, _ = motion(200, 6, noise=noise, seed=4)
        points[:100, 4:], points[100:, 0], points[100:, 3] = np.nan, np.nan, np.nan
        found = register(points)
        assert (found.rounds, found.converged) == (MAX_ROUNDS, converged)


def test_collinear_points_give_no_pose():
    points, _, _ = motion(50, 4, noise=0.0, seed=5)
    line = np.linspace(0, 1, 4)[None, :, None] * points[:, :1] + 1.0
    assert not register(line).valid.any()
    noisy = line + 0.02 * np.random.default_rng(0).normal(size=line.shape)
    assert not register(noisy).valid.any()
