"""Paths of the CoM against numpy's Chebyshev series, the difference of two Kepler orbits, and central differences."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from baryscope.estimator.dynamics.paths import Polynomial, Smooth
from baryscope.estimator.dynamics.prior import Prior
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
    """By e² each, up to e⁶, in its own coordinate."""
    prior = Smooth(6, 0.0, 1.0).prior
    untold = np.zeros((7, 3))
    untold[3:, 0] = 1.0
    untold[6, 1] = 0.5
    wider = (prior.scattered(untold.ravel()).offset[3:] - prior.offset[3:]).reshape(6, 3)
    np.testing.assert_allclose(wider[:, 0], [0, 0, 2, 4, 6, 6])
    np.testing.assert_allclose(wider[:, 1], [0, 0, 0, 0, 0, 1])
    assert not wider[:, 2].any()


def test_only_a_smooth_path_has_a_scattered_law():
    noise = Prior.known(np.ones(2))
    both = Smooth(2, 0.0, 1.0).prior.joined(noise).scattered(np.ones(11))
    np.testing.assert_allclose(both.offset[3:], [2, 2, 2, 4, 4, 4, 0, 0])
    assert noise.scattered(np.ones(2)) is noise
