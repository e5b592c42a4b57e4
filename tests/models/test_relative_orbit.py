"""Closed-form relative motion against integrations, Clohessy–Wiltshire, another program, and two Kepler orbits."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import oracles
from baryscope.models.errors import ComputationError
from baryscope.models.keplerian import Ellipse, conic
from baryscope.models.orbit import Orbit
from baryscope.models.relative_motion import relative_acceleration
from baryscope.models.relative_orbit import (
    paths_from_chaser,
    relative_path,
    relative_transition,
    step_in_chaser_axes,
)

MU = 3.986004418e14
PERIGEE = 7.0e6
ECCENTRICITIES = [0.0, 1e-9, 0.001, 0.1, 0.7]
INTEGRATION_TOLERANCE = 1e-9  # of the matrix, lengths in units of v/n: what DOP853 at 1e-12 leaves
IDENTITY_TOLERANCE = 1e-11
PATH_TOLERANCE = 1e-9  # m, with 1e-13 of ρ beside it
STATE = np.array([3.0, -20.0, 1.0, 0.01, 0.002, -0.03])

orbits = st.builds(
    lambda e, anomaly: orbit(e, anomaly), st.floats(0, 0.7) | st.sampled_from([0.0, 1e-14, 0.7]), st.floats(-400, 400)
)
turns = st.floats(-4, 4)  # times in periods


def orbit(eccentricity, true_anomaly_deg=200.0):
    return Orbit(
        semi_major_axis=PERIGEE / (1 - eccentricity),
        eccentricity=eccentricity,
        inclination=np.deg2rad(98.0),
        raan=np.deg2rad(40.0),
        true_anomaly=np.deg2rad(true_anomaly_deg),
    )


def in_orbit_units(transition, orbit):
    """Φ for velocities in units of n × length, so that all of its elements are numbers of the same kind."""
    unit = np.repeat([1.0, 1 / orbit.mean_motion], 3)
    return transition * unit[:, None] / unit


def rates_of(orbit, theta):
    """r, θ̇, θ̈ at a true anomaly."""
    e = orbit.eccentricity
    p = orbit.semi_major_axis * (1 - e**2)
    r = p / (1 + e * np.cos(theta))
    rate = np.sqrt(MU * p) / r**2
    return r, rate, -2 * np.sqrt(MU / p) * e * np.sin(theta) * rate / r


def integrated_transition(orbit, time, theta0):
    """Φ from time 0 by DOP853 at 1e-12 on the linearised equations, θ integrated along; time in one direction."""

    def rates(_, y):
        r, w, w_dot = rates_of(orbit, y[0])
        k = MU / r**3
        phi = y[1:].reshape(6, 6)
        stiffness = np.array([[w**2 + 2 * k, w_dot, 0], [-w_dot, w**2 - k, 0], [0, 0, -k]])
        spin = np.array([[0, 2 * w, 0], [-2 * w, 0, 0], [0, 0, 0]])
        return np.concatenate([[w], phi[3:].ravel(), (stiffness @ phi[:3] + spin @ phi[3:]).ravel()])

    start = np.concatenate([[theta0], np.eye(6).ravel()])
    atol = np.concatenate([[1e-12], np.repeat([1e-12, 1e-15], 18)])
    solution = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-12, atol=atol)
    return solution.y[1:].T.reshape(-1, 6, 6)


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
@pytest.mark.parametrize("turns", [1.7, -1.2], ids=["forwards", "backwards"])
@pytest.mark.parametrize("anomaly_deg", [0.0, 130.0])
def test_transition_is_that_of_the_linearised_equations(eccentricity, turns, anomaly_deg):
    flown = orbit(eccentricity, anomaly_deg)
    time = turns * flown.period * np.array([0.0, 0.01, 0.3, 0.31, 0.8, 1.0])
    expected = in_orbit_units(integrated_transition(flown, time, np.deg2rad(anomaly_deg)), flown)
    found = in_orbit_units(relative_transition(flown, time), flown)
    assert np.abs(found - expected).max() < INTEGRATION_TOLERANCE * np.abs(expected).max()


def test_transition_on_a_circular_orbit_is_clohessy_wiltshires():
    flown = orbit(0.0)
    n, time, epoch = flown.mean_motion, np.linspace(-9000.0, 9000.0, 37), 500.0
    t = time - epoch
    c, s, one, zero = np.cos(n * t), np.sin(n * t), np.ones_like(t), np.zeros_like(t)
    expected = np.array(
        [
            [4 - 3 * c, zero, zero, s / n, 2 / n * (1 - c), zero],
            [6 * (s - n * t), one, zero, -2 / n * (1 - c), (4 * s - 3 * n * t) / n, zero],
            [zero, zero, c, zero, zero, s / n],
            [3 * n * s, zero, zero, c, 2 * s, zero],
            [-6 * n * (1 - c), zero, zero, -2 * s, 4 * c - 3, zero],
            [zero, zero, -n * s, zero, zero, c],
        ]
    ).transpose(2, 0, 1)
    found = relative_transition(flown, time, epoch)
    np.testing.assert_allclose(in_orbit_units(found, flown), in_orbit_units(expected, flown), atol=1e-11)


@pytest.mark.parametrize(
    "eccentricity, time, expected",
    [
        (0.1, 13_260.0, (-2908.182250516494, 6.202752618784139, 195.5364351224569)),
        (0.7, 69_060.0, (-10326.759184987815, 6.20243448860358, 3260.6919703051335)),
    ],
)
def test_transition_of_the_papers_example(eccentricity, time, expected):
    """Perigee at 500 km, θ = 45°, start 100, 10, 10 m and 0.1 m/s thrice, as another program propagates it.

    The numbers are those of the tests of `beyond` (github.com/galactics/beyond, tests of propagators.rpo.ya), with its
    Earth: G = 6.6740831e-11, 5.97237e24 kg, 6378136.3 m; in the paper's axes (along the track, against the orbit
    normal, down).
    """
    flown = Orbit(
        semi_major_axis=(500e3 + 6378136.3) / (1 - eccentricity),
        eccentricity=eccentricity,
        inclination=np.deg2rad(30.0),
        true_anomaly=np.deg2rad(45.0),
        gravitational_parameter=6.6740831e-11 * 5.97237e24,
    )
    start = [-10, 100, -10, -0.1, 0.1, -0.1]
    x, y, z = relative_transition(flown, [time])[0, :3] @ start
    np.testing.assert_allclose([y, -z, -x], expected, rtol=1e-8)


@given(flown=orbits, first=turns, second=turns, third=turns)
def test_transitions_are_a_group(flown, first, second, third):
    """Φ(c, a) = Φ(c, b) Φ(b, a), and Φ(a, a) = 1."""
    a, b, c = np.array([first, second, third]) * flown.period
    ab, ac, aa = in_orbit_units(relative_transition(flown, [b, c, a], a), flown)
    bc = in_orbit_units(relative_transition(flown, [c], b), flown)[0]
    scale = np.abs(bc).max() * np.abs(ab).max()
    np.testing.assert_allclose(bc @ ab, ac, atol=IDENTITY_TOLERANCE * scale)
    np.testing.assert_allclose(aa, np.eye(6), atol=IDENTITY_TOLERANCE)


@given(flown=orbits, time=turns)
def test_transitions_are_symplectic(flown, time):
    """In ρ and the inertial velocity ρ̇ + θ̇ e_z × ρ the motion is that of a Hamiltonian: Φᵀ Ω Φ = Ω, det Φ = 1."""
    moment = time * flown.period
    phi = in_orbit_units(relative_transition(flown, [moment], 0.0), flown)[0]
    theta0 = flown.true_anomaly
    target, _ = oracles.inertial_states(flown, np.zeros(3), np.zeros(3))
    r, v = (np.asarray(x, dtype=float) for x in oracles.propagate_kepler(*target, MU, moment))
    start, end = np.eye(6), np.eye(6)
    for matrix, rate in ((start, rates_of(flown, theta0)[1]), (end, np.linalg.norm(np.cross(r, v)) / (r @ r))):
        matrix[3:, :3] = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]]) * rate / flown.mean_motion
    canonical = end @ phi @ np.linalg.inv(start)
    omega = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    atol = 1e-10 * np.abs(canonical).max() ** 2
    np.testing.assert_allclose(canonical.T @ omega @ canonical, omega, atol=atol)


@given(
    flown=orbits,
    time=st.lists(turns, min_size=1, max_size=5),
    epoch=turns,
    position=st.tuples(*[st.floats(-100, 100)] * 3),
    velocity=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
)
def test_path_is_the_difference_of_two_kepler_orbits(flown, time, epoch, position, velocity):
    """Held against extended precision: plain differences of doubles would be off by some 1e-8 m."""
    moments, start = np.array(time) * flown.period, np.concatenate([position, velocity])
    found = relative_path(flown, start, moments, epoch * flown.period)
    expected = oracles.relative_kepler(flown, start, moments, epoch * flown.period)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], rtol=0, atol=PATH_TOLERANCE + 1e-13 * abs(expected).max())
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], rtol=0, atol=1e-12 + 1e-15 * abs(expected).max())


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.7])
def test_path_of_a_chaser_far_away(eccentricity):
    """1,000 km and 300 m/s off, drifting whole turns away."""
    start = [1e6, -2e5, 3e5, -100.0, -300.0, 200.0]
    flown = orbit(eccentricity)
    time = np.linspace(-5.0, 5.0, 41) * flown.period
    expected = oracles.relative_kepler(flown, start, time)
    np.testing.assert_allclose(relative_path(flown, start, time), expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.7])
def test_path_obeys_the_equations_of_motion(eccentricity):
    """DOP853 on our (4) over one orbit."""
    flown = orbit(eccentricity, 40.0)
    theta, position, velocity = ca.SX.sym("theta"), ca.SX.sym("rho", 3), ca.SX.sym("rho_dot", 3)
    here = conic(Ellipse.of(flown.semi_major_axis, eccentricity, MU), theta)
    pull = relative_acceleration(position, velocity, ca.SX.zeros(3), here)
    rates = ca.Function(
        "rates", [ca.vertcat(theta, position, velocity)], [ca.vertcat(here.anomaly_rate, velocity, pull)]
    )
    time = np.linspace(0, flown.period, 25)
    solution = solve_ivp(
        lambda _, x: np.array(rates(x)).ravel(), (0, time[-1]), [np.deg2rad(40.0), *STATE], "DOP853", time,
        rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    found = relative_path(flown, STATE, time)
    np.testing.assert_allclose(found[:, :3], solution.y[1:4].T, atol=1e-6)
    np.testing.assert_allclose(found[:, 3:], solution.y[4:].T, atol=1e-9)


@pytest.mark.parametrize("eccentricity", ECCENTRICITIES)
def test_near_the_target_path_and_transition_agree(eccentricity):
    """At a hundredth of a millimetre what the matrix leaves out, ρ/r of ρ, is next to nothing."""
    flown = orbit(eccentricity)
    time = np.linspace(-2, 2, 33) * flown.period
    linear = relative_transition(flown, time) @ (1e-6 * STATE)
    exact = relative_path(flown, 1e-6 * STATE, time)
    unit = np.repeat([1.0, 1 / flown.mean_motion], 3)
    assert np.abs((exact - linear) * unit).max() < 1e-10 * np.abs(linear * unit).max()


@given(flown=orbits, epoch=turns)
def test_path_begins_with_its_state(flown, epoch):
    moment = epoch * flown.period
    np.testing.assert_allclose(relative_path(flown, STATE, [moment], moment)[0], STATE, rtol=1e-13)


def test_no_times():
    assert relative_path(orbit(0.1), STATE, []).shape == (0, 6)
    assert relative_transition(orbit(0.1), []).shape == (0, 6, 6)


@pytest.mark.parametrize("velocity", [(0.0, 4000.0, 0.0), (np.nan, 0.0, 0.0)])
def test_a_chaser_on_no_ellipse(velocity):
    with pytest.raises(ComputationError, match=r"relative state \[3\.0, -20\.0.*open"):
        relative_path(orbit(0.1, 0.0), [*STATE[:3], *velocity], [10.0])


@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.7])
def test_the_step_in_the_chasers_axes_is_the_difference_of_two_kepler_orbits(eccentricity):
    """And its transition that of small changes, by differences of the same."""
    target = orbit(eccentricity)
    begin, end = 300.0, 900.0
    mu = target.gravitational_parameter

    def path(rho, rate, time):
        first, second = oracles.inertial_states(target, rho, rate)
        here, there = (oracles.propagate_kepler(*start, mu, time) for start in (first, second))
        return np.concatenate([here[0] - there[0], here[1] - there[1]]).astype(float)

    moved, transition = step_in_chaser_axes()(begin, end, target.elements, path(STATE[:3], STATE[3:], begin))
    assert np.asarray(moved)[:3, 0] == pytest.approx(path(STATE[:3], STATE[3:], end)[:3], abs=PATH_TOLERANCE)
    assert np.asarray(moved)[3:, 0] == pytest.approx(path(STATE[:3], STATE[3:], end)[3:], abs=PATH_TOLERANCE * 1e-2)
    for k, size in enumerate([1.0] * 3 + [1e-3] * 3):  # from the target itself, where the motion is linear
        change = np.eye(6)[k] * size
        before, after = (path(change[:3], change[3:], time) for time in (begin, end))
        assert np.asarray(transition) @ before == pytest.approx(after, abs=1e-6 * np.abs(after).max())


def test_paths_of_pairs_are_differences_of_two_kepler_orbits_each():
    """Of three pairs on orbits of their own; of a fourth the chaser leaves on a hyperbola."""
    targets, begin, end = [orbit(e) for e in (0.0, 0.1, 0.7, 0.1)], 300.0, np.array([-200.0, 900.0])
    starts, expected = [], []
    for k, target in enumerate(targets):
        rho, rate = np.array(STATE[:3]) + k, np.array(STATE[3:])
        both = oracles.inertial_states(target, rho, rate)
        mu, every = target.gravitational_parameter, (begin, *end)
        at = [[oracles.propagate_kepler(*one, mu, time) for one in both] for time in every]
        apart = [np.concatenate([a[0] - b[0], a[1] - b[1]]).astype(float) for a, b in at]
        starts.append(apart[0])
        expected.append(apart[1:])
    starts[3][3:] += 8e3
    found = paths_from_chaser([one.elements for one in targets], begin, starts, end)
    np.testing.assert_allclose(found[:3, :, :3], np.array(expected)[:3, :, :3], atol=PATH_TOLERANCE)
    np.testing.assert_allclose(found[:3, :, 3:], np.array(expected)[:3, :, 3:], atol=PATH_TOLERANCE * 1e-2)
    assert np.isnan(found[3]).all()
