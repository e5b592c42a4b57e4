"""Paths of the CoM against numpy's Chebyshev series, scipy's Bessel functions, the difference of two Kepler orbits, and
central differences.
"""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.spatial.transform import Rotation
from scipy.special import jv

from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.path import DECAY, FREQUENCY, OVERTONES, Polynomial, SmoothPath
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.estimator.paths.trajectory import Trajectory, chosen_path, trajectory_of
from baryscope.estimator.thrust import KnownAcceleration
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
    assert isinstance(Trajectory("polynomial").path(None, 0.0, 1.0), SmoothPath)
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


@pytest.mark.parametrize("trajectory", ["fixed", "polynomial:0"])
def test_what_accelerates_a_point_that_is_fixed_is_refused(trajectory):
    """It was taken, and neither a point at rest nor one that moves was found."""
    pushed = KnownAcceleration([0.0, 50.0], np.full((2, 3), 0.01))
    with pytest.raises(InputError, match=r"^acceleration: found with a fixed trajectory, expected one"):
        chosen_path(PathOptions(trajectory=trajectory, acceleration=pushed), None, 0.0, 100.0)
    with pytest.raises(InputError, match=r"^constant_acceleration: found with a fixed trajectory"):
        chosen_path(PathOptions(trajectory=trajectory, constant_acceleration="inertial"), None, 0.0, 100.0)


def test_a_coefficient_that_is_not_told_loosens_the_law_for_all_higher_ones():
    """By e each, up to e⁶, along its own axis, whatever the coordinates: it was by their shares along these."""
    prior = SmoothPath(9, 0.0, 1.0).prior
    untold = np.zeros((10, 3))
    untold[3:, 0] = 1.0
    untold[9, 1] = 0.5
    turn = np.kron(np.eye(10), Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix())
    for axes in (np.eye(30), turn):
        scattered, principal = prior.scattered(axes @ np.diag(untold.ravel()) @ axes.T)
        above = np.append(np.zeros(3), scattered.offset[3:] - prior.offset[3:])
        expected = np.zeros((10, 3))
        expected[1:, 0] = [0, 0, 1, 2, 3, 4, 5, 6, 6]
        expected[9, 1] = 0.5
        found = axes.T @ (principal * above) @ principal.T @ axes
        np.testing.assert_allclose(found, np.diag(expected.ravel()), atol=1e-12)


def deviations(theta, degree=24):
    """Those of the coefficients of a smooth path by its law, in the first coordinate."""
    return 1 / np.sqrt(SmoothPath(degree, 0.0, 1.0).prior.precision(np.array(theta))[3::3])


@pytest.mark.parametrize("x", [0.03, 0.3, 3.3, 11.7])
def test_the_law_of_a_smooth_path_is_the_envelope_of_the_coefficients_of_waves(x):
    """cos(x t + phase) has the Chebyshev coefficients 2 Jⱼ(x) times a cosine or sine of the phase.

    Debye's expansion has a factor (2π √(j² − x²))^−½ besides, and relative terms of 1/(12 j). The law has (j/x)^(−5/3)
    instead, or j^(−5/3) where x is less than one, and a rate of ln(1 + x⁻³)/3, which is far less. Up to x it is
    nearly one. Overtones come after the knee, here where they are the least.
    """
    order = np.arange(1.0, np.hypot(x, DECAY[1]))
    found = deviations((0.0, np.log(x), DECAY[1]), len(order))
    beyond = order > x + 2
    bessel = np.log(np.abs(jv(order[beyond], x))) + np.log((order[beyond] ** 2 - x**2) ** 0.25)
    law = np.log(found[beyond]) + 5 / 3 * np.log(order[beyond])
    np.testing.assert_allclose(law - law[0], bessel - bessel[0], atol=0.15 if x > 0.1 else 0.02 * order[-1])
    np.testing.assert_allclose(found[order <= x], 1.0, atol=0.02)


@pytest.mark.parametrize("eccentricity, begin, end", [(0.3, -1.2, 1.9), (0.6, 0.4, 3.1), (0.7, 2.0, 5.5)])
def test_the_law_is_that_of_an_ellipses_coefficients(eccentricity, begin, end):
    """Kepler's motion, with its branch points in complex time as (t − t*)^⅔: as ρ^−j j^(−5/3), twice over for a pair.

    ρ is of the ellipse about ±1 on which the branch points are (Trefethen 2019, Approximation Theory, theorem 8.1):
    E − e sin E has no slope at E = i arcosh(1/e), where M is i (arcosh(1/e) − √(1 − e²)).
    """
    grid = np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    anomaly = (begin + end) / 2 + (end - begin) / 2 * grid
    E = anomaly.copy()
    for _ in range(100):
        E -= (E - eccentricity * np.sin(E) - anomaly) / (1 - eccentricity * np.cos(E))
    across = np.sqrt(1 - eccentricity**2) * np.sin(E)
    coefficients = np.polynomial.chebyshev.chebfit(grid, np.column_stack([np.cos(E), across]), 60)
    branch = 1j * (np.arccosh(1 / eccentricity) - np.sqrt(1 - eccentricity**2)) + 2 * np.pi * np.arange(-1, 2)
    z = (branch - (begin + end) / 2) / ((end - begin) / 2)
    rate = np.log(np.abs(z + np.sqrt(z - 1) * np.sqrt(z + 1))).min()
    assert 0 < rate < 3
    tail = slice(4, int(min(40, 22 / rate)))
    t = -np.log(np.expm1(3 * rate)) / 3  # by which the law has this rate
    law = np.log(deviations((0.0, t, 0.0), 60))[tail]
    size = np.log(np.linalg.norm(coefficients[1:], axis=1))[tail]
    order = np.arange(1, 61)[tail]
    slope, _ = np.polyfit(order, size - law, 1)
    assert abs(slope) < 0.05 * rate
    assert np.std(size - law) < 0.8


@pytest.mark.parametrize(("x", "decay"), [(4.0, 1.0), (6.3, 5.0), (11.7, 0.3)])
def test_the_law_is_that_of_the_greatest_of_all_overtones(x, decay):
    """Over all k ≥ 1, whole or not, of e^(−η (k − 1)) times the law of a wave of k x, but for the power.

    The law has a rate of ln(1 + x⁻³)/3 besides.
    """
    order = np.arange(1.0, 41.0)
    waves = x * np.geomspace(1.0, 400.0, 20_001)[:, None]
    beyond = np.maximum(order, waves)
    bessel = beyond * np.arccosh(beyond / waves) - np.sqrt(beyond**2 - waves**2)
    least = (decay * (waves / x - 1) + bessel).min(axis=0)
    power = np.maximum(order / x, 1.0) ** (-5 / 3)
    found = -np.log(deviations((0.0, np.log(x), decay), 40) / power)
    np.testing.assert_allclose(found, least, atol=40 * x**-3 / 3 + 0.02)


def test_the_law_has_no_jump_from_a_rate_to_a_frequency():
    for decay in (0.0, 0.3, 3.0, 10.0):
        at = np.array([np.log(deviations((0.0, t, decay))) for t in np.linspace(-1, 1, 2001)])
        assert np.abs(np.diff(at, axis=0)).max() < 0.05


@pytest.mark.parametrize("theta", [(0.5, -3.0, 0.9), (-2.0, 0.2, 3.3), (1.0, 2.1, 0.7), (1.0, 2.1, 9.7)])
def test_the_law_has_its_derivatives(theta):
    """With other unknowns and hyperparameters before and after it."""
    noise = Prior(np.zeros(2), np.ones((2, 1)), (Hyperparameter("scale"),))
    prior, at = noise.joined(SmoothPath(12, 0.0, 1.0).prior).joined(noise), np.array([0.4, *theta, -0.7])
    own, steps = ~prior.free, 1e-6 * np.eye(5)
    expected = [np.log(prior.precision(at - h)[own] / prior.precision(at + h)[own]) / 2e-6 for h in steps]
    np.testing.assert_allclose(prior.derivatives(at)[~prior.free], np.transpose(expected), atol=1e-6)
    assert ((prior.derivatives(at) != 0) <= prior.uses).all()


def test_a_fixed_hyperparameter_and_fewer_unknowns_leave_the_other_variances_as_they_are():
    noise = Prior(np.zeros(2), np.ones((2, 1)), (Hyperparameter("scale"),))
    prior, at = noise.joined(SmoothPath(5, 0.0, 1.0).prior).joined(noise), np.array([0.4, 0.5, -0.6, 0.7, -0.8])
    for name in ("scale", "first coefficient", FREQUENCY, OVERTONES):
        index = prior.index(name)
        fixed = prior.fixed(name, at[index])
        np.testing.assert_allclose(fixed.precision(np.delete(at, index)), prior.precision(at), rtol=1e-12)
    fixed = prior.fixed(OVERTONES, 0.7).fixed(FREQUENCY, -0.6)
    assert fixed.trend is None
    np.testing.assert_allclose(fixed.precision(np.array([0.4, 0.5, -0.8])), prior.precision(at), rtol=1e-12)
    kept = np.array([1, 6, 9, 11, 20])
    np.testing.assert_array_equal(prior.of(kept).precision(at), prior.precision(at)[kept])


def test_only_a_smooth_path_has_a_scattered_law():
    noise = Prior.known(np.ones(2))
    both, axes = SmoothPath(2, 0.0, 1.0).prior.joined(noise).scattered(np.eye(11))
    np.testing.assert_allclose(both.offset[3:], [1, 1, 1, 2, 2, 2, 0, 0])
    np.testing.assert_array_equal(axes[-2:], np.eye(11)[-2:])
    np.testing.assert_array_equal(noise.scattered(np.eye(2))[0].offset, noise.offset)
