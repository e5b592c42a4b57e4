"""Paths of the CoM against numpy's Chebyshev series, scipy's Bessel functions, the difference of two Kepler orbits, and
central differences.
"""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.special import jv

from baryscope.estimator.dynamics.paths import FREQUENCY, STEEP, Polynomial, Smooth
from baryscope.estimator.dynamics.prior import Hyperparameter, Prior
from baryscope.estimator.dynamics.relative_motion import RelativeOrbit
from baryscope.estimator.dynamics.trajectory import Trajectory, trajectory_of
from baryscope.models.errors import InputError
from oracles import inertial_states, propagate_kepler
from synthetic import MU, Orbit

START = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))  # of the chaser in LVLH, m and m/s


def differences(position, x, step):
    """Central differences of position (n, 3) by x: (n, 3, p)."""
    return np.stack([(position(x + h) - position(x - h)) / (2 * step) for h in step * np.eye(len(x))], axis=2)


@pytest.mark.parametrize("degree", [0, 1, 5, 20])
def test_polynomial_agrees_with_numpy(degree):
    path = Polynomial(degree, 100.0, 700.0)
    time = np.linspace(50.0, 720.0, 30)
    x = np.random.default_rng(degree).normal(size=path.size)
    expected = [Chebyshev(x.reshape(-1, 3)[:, axis], domain=[100, 700])(time) for axis in range(3)]
    sampled = path.at(time)
    found = sampled.position(x)
    np.testing.assert_allclose(found, np.transpose(expected), rtol=1e-12, atol=1e-12 * np.abs(found).max())
    np.testing.assert_allclose(sampled.jacobian @ x, found, rtol=1e-12, atol=1e-12 * np.abs(found).max())
    scale = np.abs(sampled.jacobian).max()
    np.testing.assert_allclose(differences(sampled.position, x, 1.0), sampled.jacobian, atol=1e-9 * scale)


def test_a_single_frame_has_a_path():
    sampled = Polynomial(0, 5.0, 5.0).at(np.array([5.0]))
    np.testing.assert_array_equal(sampled.position(np.array([1.0, 2.0, 3.0])), [[1, 2, 3]])


@pytest.mark.parametrize("eccentricity", [0.001, 0.4])
def test_relative_orbit_is_the_difference_of_two_kepler_orbits(eccentricity):
    """x at an epoch inside the span from the states at time 0 by Lagrange's f and g, and the path from this x."""
    orbit = Orbit(eccentricity=eccentricity, semi_major_axis=7150e3 if eccentricity < 0.1 else 15000e3)
    target, chaser = inertial_states(orbit.model(), *START)
    epoch, time = 1000.0, np.linspace(-2000.0, 6000.0, 33)

    def states(t):
        return propagate_kepler(*target, MU, t), propagate_kepler(*chaser, MU, t)

    (r, v), (r_chaser, v_chaser) = states(epoch)
    R_I_L = orbit.R_I_L(np.array([epoch]))[0]
    spin = np.cross(r, v) / (r @ r)
    rho, rho_rate = r_chaser - r, v_chaser - v - np.cross(spin, r_chaser - r)
    n = 2 * np.pi / orbit.period
    x = np.concatenate([R_I_L.T @ rho, R_I_L.T @ rho_rate / n]).astype(float)
    path = RelativeOrbit(orbit.model(), epoch)
    expected = np.array([near[0] - far[0] for near, far in map(states, time)], dtype=float)
    # Distances reach 10 km; 2e-6 m is some 1e-13 of the orbit's radius, the rounding of elements in double precision.
    np.testing.assert_allclose(path.at(time).position(x), expected, atol=2e-6)
    assert path.size == 6
    assert path.name == "relative-orbit"


@pytest.mark.parametrize("eccentricity", [0.001, 0.4])
def test_jacobian_of_the_relative_orbit_is_that_of_a_path_near_the_target(eccentricity):
    orbit = Orbit(eccentricity=eccentricity, semi_major_axis=15000e3)
    sampled = RelativeOrbit(orbit.model(), 500.0).at(np.linspace(0.0, 3000.0, 13))
    found = differences(sampled.position, np.zeros(6), 1.0)
    np.testing.assert_allclose(found, sampled.jacobian, atol=1e-7 * np.abs(found).max())
    # 20 m away they differ by the order of ρ/r = 20 m / 9,000 km.
    away = differences(sampled.position, np.concatenate([START[0], START[1] / 1e-3]), 1.0)
    np.testing.assert_allclose(away, sampled.jacobian, atol=1e-4 * np.abs(found).max())


def test_trajectories_by_name():
    orbit = Orbit().model()
    assert trajectory_of(None, None) == Trajectory("polynomial")
    assert trajectory_of(None, orbit) == Trajectory("relative-orbit")
    assert trajectory_of("fixed", orbit) == trajectory_of("polynomial:0", None) == Trajectory("polynomial", 0)
    assert trajectory_of("polynomial:20", None) == Trajectory("polynomial", 20)
    assert trajectory_of("polynomial", orbit) == Trajectory("polynomial")
    assert isinstance(Trajectory("polynomial").path(None, 0.0, 1.0), Smooth)
    assert Trajectory("polynomial", 0).path(orbit, 0.0, 1.0).name == "fixed"
    relative = trajectory_of("relative-orbit", orbit).path(orbit, 10.0, 30.0)
    assert isinstance(relative, RelativeOrbit)
    assert relative.epoch == 20.0


@pytest.mark.parametrize(
    "text", ["", "linear", "polynomial:", "polynomial:x", "polynomial:-1", "polynomial:1.5", "fixed:1", "orbit"]
)
def test_unknown_names_are_refused_with_the_known_ones(text):
    with pytest.raises(InputError) as caught:
        trajectory_of(text, None)
    assert str(caught.value) == f"trajectory is {text!r}, expected fixed, polynomial, polynomial:N or relative-orbit"


def test_impossible_trajectories_are_refused():
    with pytest.raises(InputError, match="trajectory is 'polynomial:21', expected a degree of 0 to 20"):
        trajectory_of("polynomial:21", None)
    with pytest.raises(InputError, match="needs the target's orbit; expected an orbit"):
        trajectory_of("relative-orbit", None)


def test_a_coefficient_that_is_not_told_loosens_the_law_for_all_higher_ones():
    """By e each, up to e⁶, in its own coordinate."""
    prior = Smooth(9, 0.0, 1.0).prior
    untold = np.zeros((10, 3))
    untold[3:, 0] = 1.0
    untold[9, 1] = 0.5
    wider = (prior.scattered(untold.ravel()).offset[3:] - prior.offset[3:]).reshape(9, 3)
    np.testing.assert_allclose(wider[:, 0], [0, 0, 1, 2, 3, 4, 5, 6, 6])
    np.testing.assert_allclose(wider[:, 1], [0, 0, 0, 0, 0, 0, 0, 0, 0.5])
    assert not wider[:, 2].any()


@pytest.mark.parametrize("x", [0.03, 0.9, 3.3, 11.7])
def test_the_law_of_a_smooth_path_is_the_envelope_of_the_coefficients_of_waves(x):
    """cos(x t + phase) has the Chebyshev coefficients 2 Jⱼ(x) times a cosine or sine of the phase.

    Debye's expansion has a factor (2π √(j² − x²))^−½ besides, and relative terms of 1/(12 j): beyond the turning point
    j = x this is far less than the decrease. Below it, no |Jⱼ(x)| is above √(2/(π √(x² − j²))), and that is the law's.
    """
    order = np.arange(1.0, 25.0)
    deviations = 1 / np.sqrt(Smooth(24, 0.0, 1.0).prior.precision(np.array([0.0, np.log(x), 1.0]))[3::3])
    beyond = order > x + 2
    bessel = np.log(np.abs(jv(order[beyond], x)))
    found = np.log(deviations[beyond]) - np.log((order[beyond] ** 2 - x**2) ** 0.25)
    np.testing.assert_allclose(found - found[0], bessel - bessel[0], atol=0.1)
    np.testing.assert_array_equal(deviations[order <= x], 1.0)


def test_a_power_of_the_law_decreases_less():
    prior = Smooth(8, 0.0, 1.0).prior
    steep, flat = (np.log(prior.precision(np.array([0.3, 0.5, power]))[3::3]) + 0.3 for power in (1.0, 0.4))
    np.testing.assert_allclose(flat, 0.4 * steep, atol=1e-12)


@pytest.mark.parametrize("theta", [(0.5, -3.0, 0.9), (-2.0, 0.2, 0.3), (1.0, 2.1, 0.7)])
def test_the_law_has_its_derivatives(theta):
    """With other unknowns and hyperparameters before and after it."""
    noise = Prior(np.zeros(2), np.ones((2, 1)), (Hyperparameter("scale"),))
    prior, at = noise.joined(Smooth(12, 0.0, 1.0).prior).joined(noise), np.array([0.4, *theta, -0.7])
    own, steps = ~prior.free, 1e-6 * np.eye(5)
    expected = [np.log(prior.precision(at - h)[own] / prior.precision(at + h)[own]) / 2e-6 for h in steps]
    np.testing.assert_allclose(prior.derivatives(at)[~prior.free], np.transpose(expected), atol=1e-6)
    assert ((prior.derivatives(at) != 0) <= prior.uses).all()


def test_a_fixed_hyperparameter_and_fewer_unknowns_leave_the_other_variances_as_they_are():
    noise = Prior(np.zeros(2), np.ones((2, 1)), (Hyperparameter("scale"),))
    prior, at = noise.joined(Smooth(5, 0.0, 1.0).prior).joined(noise), np.array([0.4, 0.5, -0.6, 0.7, -0.8])
    for name in ("scale", "first coefficient", FREQUENCY, STEEP):
        index = prior.index(name)
        fixed = prior.fixed(name, at[index])
        np.testing.assert_allclose(fixed.precision(np.delete(at, index)), prior.precision(at), rtol=1e-12)
    fixed = prior.fixed(STEEP, 0.7).fixed(FREQUENCY, -0.6)
    assert fixed.trend is None
    np.testing.assert_allclose(fixed.precision(np.array([0.4, 0.5, -0.8])), prior.precision(at), rtol=1e-12)
    kept = np.array([1, 6, 9, 11, 20])
    np.testing.assert_array_equal(prior.of(kept).precision(at), prior.precision(at)[kept])


def test_only_a_smooth_path_has_a_scattered_law():
    noise = Prior.known(np.ones(2))
    both = Smooth(2, 0.0, 1.0).prior.joined(noise).scattered(np.ones(11))
    np.testing.assert_allclose(both.offset[3:], [1, 1, 1, 2, 2, 2, 0, 0])
    assert noise.scattered(np.ones(2)) is noise
