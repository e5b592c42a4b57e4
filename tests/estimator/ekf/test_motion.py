"""The process models of `ekf` against independent integrations and differences."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from baryscope.estimator.ekf.motion import (
    ROTATION,
    changed_inertia,
    free_motion,
    integrated_noise,
    logarithm_of_inertia,
    rotated,
)
from baryscope.estimator.paths.path import Polynomial
from baryscope.models.attitude import INERTIA_BASIS
from synthetic import ENVISAT, attitude

FAST = np.deg2rad([3.38, 0.45, 0.77])  # rad/s
J = ENVISAT / np.trace(ENVISAT)


def advanced(R, rate, inertia, step):
    still = np.zeros((1, 3))
    R, rate, growth = rotated(R[None], rate[None], inertia, still, np.array([step]))
    return R[0], rate[0], growth[0]


def test_rotation_against_an_independent_integration():
    truth = attitude(ENVISAT, FAST, np.array([0.0, 10.0]))[1]
    R = advanced(np.eye(3), FAST, J, 10.0)[0]
    assert Rotation.from_matrix(R.T @ truth).magnitude() < 1e-6


def test_transition_of_rotation_errors_against_differences():
    """To what central differences of 1e-5 are good for.

    It was off by up to 8e-3: a boresight that turns what is seen as a turned tumble does seemed to be told from one.
    """
    h = 4.0

    def after(error):
        inertia = of_changed_mass(error[6:])
        return advanced(Rotation.from_rotvec(error[:3]).as_matrix(), FAST + error[3:6], inertia, h)[:2]

    growth = advanced(np.eye(3), FAST, J, h)[2]
    for index in range(ROTATION):
        step = np.zeros(ROTATION)
        step[index] = 1e-5
        (R1, w1), (R0, w0) = after(step), after(-step)
        difference = np.concatenate([Rotation.from_matrix(R0.T @ R1).as_rotvec(), w1 - w0]) / 2e-5
        np.testing.assert_allclose(growth[:, index], difference, atol=1e-5 * np.abs(difference).max())


def of_changed_mass(change):
    """The inertia of second moments A exp(Σ δ E) Aᵀ of the mass, A Aᵀ those of J."""
    root = np.linalg.cholesky(np.trace(J) / 2 * np.eye(3) - J)
    mass = root @ expm(np.tensordot(change, INERTIA_BASIS, 1)) @ root.T
    return np.trace(mass) * np.eye(3) - mass


def test_inertia_changes_by_the_exponential_of_its_errors():
    change = np.array([0.02, -0.01, 0.05, 0.03, -0.02])
    expected = of_changed_mass(change)
    np.testing.assert_allclose(changed_inertia(J, change), expected / np.trace(expected), atol=1e-12)


def test_no_change_leads_to_an_inertia_that_no_body_has():
    """Principal moments of a body obey the triangle inequality; of a linear change of J they do not."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        least, middle, greatest = np.linalg.eigvalsh(changed_inertia(J, rng.normal(size=5)))
        assert least + middle > greatest


def test_an_inertia_of_which_nothing_is_known_stays_that_of_a_body():
    """Members of a posterior as wide as that had moments of mass beyond all numbers: a prediction ended in an error."""
    error = np.random.default_rng(1).normal(size=5)
    far, farther = (changed_inertia(J, size * error, np.inf) for size in (1e3, 1e5))
    np.testing.assert_allclose(farther, far, atol=1e-3)  # what is thinnest in one is no thicker in the other
    assert np.trace(farther) == pytest.approx(1)
    assert np.linalg.eigvalsh(farther)[-1] <= 0.5


def test_the_logarithm_of_an_inertia_leads_to_a_sphere():
    """In any axes; by steps, as one is bounded."""
    np.testing.assert_allclose(logarithm_of_inertia(np.eye(3) / 3), 0.0, atol=1e-15)
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    inertia = turn @ np.diag([0.15, 0.38, 0.47]) @ turn.T
    for share in (3, 2, 1):
        inertia = changed_inertia(inertia, -logarithm_of_inertia(inertia) / share)
    np.testing.assert_allclose(inertia, np.eye(3) / 3, atol=1e-12)


def test_white_noise_of_unit_density():
    """The position's variance after 15 s: ∫ (15 − t)² dt; that of the velocity is 15."""
    time = np.array([0.0, 3.0, 4.0, 9.0, 15.0])
    process, noise = free_motion(Polynomial(1, 0.0, 15.0), time, np.zeros(3), 15.0), integrated_noise(time, 15.0)
    covariance = np.zeros_like(noise[0])
    for transition, added in zip(process.transition, noise, strict=True):
        covariance = transition @ covariance @ transition.T + added
    np.testing.assert_allclose(covariance[:3, :3], 15.0**3 / 3 * np.eye(3), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(covariance[3:, 3:] / 15.0**2, 15.0 * np.eye(3), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("degree", [0, 1, 4])
def test_a_path_without_noise_is_its_polynomial(degree):
    """Step by step, with what drives it: position and velocity of a power series, whatever the basis."""
    time, rng = np.array([0.0, 3.0, 4.0, 9.0, 15.0]), np.random.default_rng(5)
    path, origin = Polynomial(degree, 0.0, 15.0), np.array([4.0, -19.0, 3.0])
    process, x = free_motion(path, time, origin, 15.0), rng.normal(size=3 * (degree + 1))
    u = [process.columns[0] @ x]
    for transition, drive in zip(process.transition, process.drive, strict=True):
        u.append(transition @ u[-1] + drive @ x)
    expected = [np.polynomial.Chebyshev(x[axis::3], domain=[0.0, 15.0]) for axis in range(3)]
    place = np.column_stack([one(time) for one in expected]) + origin
    np.testing.assert_allclose(process.position(np.array(u)), place, rtol=1e-12)
    speed = np.column_stack([one.deriv()(time) for one in expected])
    np.testing.assert_allclose(process.velocity(np.array(u)), speed, rtol=1e-11, atol=1e-12)


def test_integrated_noise_adds_up_over_steps():
    """Of a body at rest: ∫ of (T − t, 1) (T − t, 1)ᵀ over 5 s, in one step and in two."""
    one, two = integrated_noise(np.array([0.0, 5.0]))[0], integrated_noise(np.array([0.0, 2.0, 5.0]))
    F = np.kron([[1.0, 3.0], [0.0, 1.0]], np.eye(3))
    np.testing.assert_allclose(F @ two[0] @ F.T + two[1], one, rtol=1e-12)
    np.testing.assert_allclose(one[[0, 0, 3], [0, 3, 3]], [125 / 3, 25 / 2, 5.0])
