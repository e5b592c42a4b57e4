"""Rigid rotation against Jacobi's elliptic functions, scipy's integrator, and closed forms of the torques."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import oracles
from baryscope.models.attitude import (
    INERTIA_BASIS,
    angular_acceleration,
    angular_momentum,
    gravity_gradient_torque,
    inertia_tensor,
    principal_axes,
    rotational_energy,
    symmetric_inverse,
    tumble_step,
)
from baryscope.models.scenario import load_scenario
from baryscope.models.target import tumbling_target

RATE_TOLERANCE = 1e-9  # of the rate, over one orbit
ATTITUDE_TOLERANCE = 1e-8  # rad over one orbit
CONSERVATION_TOLERANCE = 1e-10  # relative, over one orbit
ORBIT = 6000.0  # s

ENVISAT = np.array([[17023.3, 397.1, -2171.4], [397.1, 124825.7, 344.2], [-2171.4, 344.2, 129112.2]])
TRIAXIAL = Rotation.from_euler("xyz", [20, -40, 70], degrees=True).as_matrix()
TRIAXIAL = TRIAXIAL @ np.diag([1.0, 2.1, 2.6]) @ TRIAXIAL.T
CASES = [
    pytest.param((ENVISAT, np.deg2rad([3.38, 0.45, 0.77])), id="envisat-about-the-least-axis"),
    pytest.param((ENVISAT, np.deg2rad([0.2, 0.5, 3.4])), id="envisat-about-the-greatest-axis"),
    pytest.param((TRIAXIAL, np.array([0.02, 0.05, 0.03])), id="triaxial"),
    pytest.param((TRIAXIAL, np.array([0.05, -0.02, 0.01])), id="triaxial-other-way"),
]


def integrated(J, rate, time):
    """(q, ω) by scipy from the equations of baryscope alone: quaternion (w, x, y, z)."""
    scenario = load_scenario("envisat")
    target = scenario.target.model_copy(
        update={"inertia": tuple(map(tuple, J)), "attitude": (1.0, 0.0, 0.0, 0.0), "angular_rate_deg": np.rad2deg(rate)}
    )
    system = tumbling_target(len(scenario.features.points))
    p = scenario.model_copy(update={"target": target}).flat_parameters()
    start = np.array(system.initial(p)).ravel()
    slopes = oracles.slope_of(system.rhs, len(start), np.zeros(6), p)
    solution = solve_ivp(slopes, (0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-14)
    return solution.y[:4].T, solution.y[4:7].T


@pytest.fixture(scope="module", params=CASES)
def flight(request):
    J, rate = request.param
    time = np.arange(0, ORBIT + 1)
    return J, rate, time, *integrated(J, rate, time)


def test_rate_is_jacobis(flight):
    J, rate, time, _, found = flight
    expected = oracles.TorqueFree(J, rate).rate(time)
    assert np.abs(found - expected).max() < RATE_TOLERANCE * np.linalg.norm(rate)


def test_attitude_is_the_closed_form(flight):
    J, rate, time, q, _ = flight
    error = (Rotation.from_quat(q, scalar_first=True).inv() * oracles.TorqueFree(J, rate).attitude(time)).magnitude()
    assert error.max() < ATTITUDE_TOLERANCE


def test_energy_and_momentum_stay(flight):
    J, _, _, q, rates = flight
    energy = np.einsum("ni,ij,nj->n", rates, J, rates) / 2
    momentum = Rotation.from_quat(q, scalar_first=True).apply(rates @ J)
    assert np.abs(energy / energy[0] - 1).max() < CONSERVATION_TOLERANCE
    assert np.linalg.norm(momentum - momentum[0], axis=1).max() < CONSERVATION_TOLERANCE * np.linalg.norm(momentum[0])
    R = Rotation.from_quat(q[-1], scalar_first=True).as_matrix()
    assert float(ca.evalf(rotational_energy(ca.DM(J), ca.DM(rates[-1])))) == pytest.approx(energy[-1], rel=1e-14)
    shown = np.array(ca.evalf(angular_momentum(ca.DM(J), ca.DM(rates[-1]), ca.DM(R)))).ravel()
    np.testing.assert_allclose(shown, momentum[-1], rtol=1e-12, atol=1e-13 * np.linalg.norm(momentum[0]))


def test_envisat_as_in_the_preset():
    """From the preset's own attitude, against scipy on plain numpy equations."""
    scenario = load_scenario("envisat")
    time = np.linspace(0, 600, 31)
    system, p = tumbling_target(12), scenario.flat_parameters()
    start = np.array(system.initial(p)).ravel()
    solution = solve_ivp(
        oracles.slope_of(system.rhs, len(start), np.zeros(6), p), (0, 600), start, "DOP853", time,
        rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    error = oracles.angle_between(solution.y[:4].T, oracles.torque_free_attitude(scenario, time))
    assert error.max() < ATTITUDE_TOLERANCE


@st.composite
def inertias(draw):
    """Tensors of ten point masses."""
    numbers = draw(st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=10, max_size=10, unique=True))
    points = np.array(numbers) + np.eye(3)[np.arange(10) % 3] * 5
    points -= points.mean(axis=0)
    return sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)


@given(J=inertias(), rate=st.tuples(*[st.floats(-1, 1)] * 3), torque=st.tuples(*[st.floats(-10, 10)] * 3))
def test_inverse_and_eulers_equation(J, rate, torque):
    inverse = np.array(ca.evalf(symmetric_inverse(ca.DM(J))))
    np.testing.assert_allclose(inverse, np.linalg.inv(J), rtol=1e-10, atol=1e-13 / np.linalg.eigvalsh(J)[0])
    found = np.array(ca.evalf(angular_acceleration(ca.DM(J), ca.inv(ca.DM(J)), ca.DM(rate), ca.DM(torque)))).ravel()
    expected = np.linalg.solve(J, np.array(torque) - np.cross(rate, J @ rate))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("moments", [(1.0, 2.1, 2.6), (1.0, 1.0, 1.5), (2.0, 2.0, 2.0), (1.0, 1.0 + 1e-12, 1.9)])
@pytest.mark.parametrize("seed", range(10))
def test_principal_axes(moments, seed):
    R = Rotation.random(rng=seed).as_matrix()
    J = R @ np.diag(moments) @ R.T
    q = np.array(ca.evalf(principal_axes(ca.SX(ca.DM((J + J.T) / 2))))).ravel()
    R_B_D = Rotation.from_quat(q, scalar_first=True).as_matrix()
    found = R_B_D.T @ J @ R_B_D
    np.testing.assert_allclose(found, np.diag(np.diag(found)), atol=5e-15)
    np.testing.assert_allclose(np.sort(np.diag(found)), moments, rtol=5e-15)


def test_a_diagonal_inertia_is_in_principal_axes():
    np.testing.assert_array_equal(
        np.array(ca.evalf(principal_axes(ca.diag(ca.SX([3.0, 2.0, 4.0]))))).ravel(), [1, 0, 0, 0]
    )


def test_inertia_tensor_puts_each_element_in_its_place():
    values = {"xx": 1, "yy": 2, "zz": 3, "xy": 4, "xz": 5, "yz": 6}
    tensor = inertia_tensor({f"target.inertia.{axes}": ca.DM(value) for axes, value in values.items()})
    np.testing.assert_array_equal(np.array(ca.evalf(tensor)), [[1, 4, 5], [4, 2, 6], [5, 6, 3]])


@pytest.mark.parametrize("axis", range(3))
def test_no_gravity_gradient_along_a_principal_axis(axis):
    up = np.linalg.eigh(ENVISAT)[1][:, axis]
    torque = np.array(ca.evalf(gravity_gradient_torque(ca.DM(ENVISAT), ca.DM(up), ca.DM(3.986e14 / 7e6**3))))
    scale = 3 * 3.986e14 / 7e6**3 * 1.3e5
    assert np.linalg.norm(torque) < 1e-14 * scale


@given(tilt=st.floats(-3, 3))
def test_gravity_gradient_of_a_tilted_body(tilt):
    """Tilted by α about z, the torque is 3 μ/r³ (B − A) sin α cos α about z."""
    A, B, C, mu, r = 2.0, 3.0, 4.0, 3.986e14, 7e6
    up = [np.cos(tilt), np.sin(tilt), 0]
    torque = np.array(ca.evalf(gravity_gradient_torque(ca.DM(np.diag([A, B, C])), ca.DM(up), ca.DM(mu / r**3))))
    expected = [0, 0, 3 * mu / r**3 * (B - A) * np.sin(tilt) * np.cos(tilt)]
    np.testing.assert_allclose(torque.ravel(), expected, atol=1e-20)


def test_libration_under_the_gravity_gradient():
    """In pitch, α̈ = −3 n² (B − A)/C α on a circular orbit; of third order in α = 1e-3 rad."""
    A, B, C, tilt = 2.0, 3.5, 4.0, 1e-3
    envisat = load_scenario("envisat")
    orbit = replace(envisat.orbit, eccentricity=0.0, argument_of_periapsis=0.0)
    n = 2 * np.pi / orbit.period
    R_I_L0 = Rotation.from_euler("ZXZ", [orbit.raan, orbit.inclination, 0])
    q = (R_I_L0 * Rotation.from_euler("z", tilt)).as_quat(scalar_first=True)
    target = envisat.target.model_copy(
        update={
            "inertia": ((A, 0.0, 0.0), (0.0, B, 0.0), (0.0, 0.0, C)),
            "attitude": tuple(q),
            "angular_rate_deg": (0.0, 0.0, np.rad2deg(n)),
            "gravity_gradient": True,
        }
    )
    p = envisat.model_copy(update={"orbit": orbit, "target": target}).flat_parameters()
    system = tumbling_target(len(envisat.features.points))
    time = np.linspace(0, orbit.period, 61)
    start = np.array(system.initial(p)).ravel()
    solution = solve_ivp(
        oracles.slope_of(system.rhs, len(start), np.zeros(6), p), (0, time[-1]), start, "DOP853", time,
        rtol=1e-12, atol=1e-14,
    )  # fmt: skip
    R_I_L = R_I_L0 * Rotation.from_euler("z", (n * time)[:, None])
    pitch = (R_I_L.inv() * Rotation.from_quat(solution.y[:4].T, scalar_first=True)).as_rotvec()
    np.testing.assert_allclose(pitch[:, 2], tilt * np.cos(np.sqrt(3 * (B - A) / C) * n * time), atol=10 * tilt**3)
    np.testing.assert_allclose(pitch[:, :2], 0, atol=1e-11)


@pytest.mark.parametrize("axis", [np.zeros(3), np.array([0.01, 0.004, -0.012])], ids=["free", "gravity gradient"])
def test_a_step_of_a_tumble_is_that_of_an_integration_and_its_jacobian_that_of_differences(axis):
    rng = np.random.default_rng(5)
    q, w = np.array([0.5, -0.5, 0.7, 0.1]), np.array([0.02, -0.03, 0.01])
    q /= np.linalg.norm(q)
    root = rng.uniform(-1, 1, (3, 3))
    mass = root @ root.T + 0.2 * np.eye(3)
    inertia = (np.trace(mass) * np.eye(3) - mass) / (2 * np.trace(mass))  # of trace 1
    step, pulled = 2.0, bool(np.any(axis))

    def stepped(turn, rate, change):
        """Attitude as a matrix and rate, by scipy."""
        J = inertia + np.tensordot(change, INERTIA_BASIS, 1)
        start = (Rotation.from_rotvec(turn) * Rotation.from_quat(q, scalar_first=True)).as_quat(scalar_first=True)

        def slope(_, x):
            v = x[4:]
            turning = np.concatenate([[-x[1:4] @ v], x[0] * v + np.cross(x[1:4], v)]) / 2
            up = Rotation.from_quat(x[:4], scalar_first=True).inv().apply(axis)
            return np.concatenate([turning, np.linalg.solve(J, np.cross(up, J @ up) - np.cross(v, J @ v))])

        done = solve_ivp(slope, (0, step), np.concatenate([start, w + rate]), "DOP853", rtol=1e-12, atol=1e-14)
        return Rotation.from_quat(done.y[:4, -1], scalar_first=True), done.y[4:, -1]

    after, rate, jacobian = (
        np.asarray(value) for value in tumble_step(pulled)(q, w, inertia.ravel(), step, *([axis] if pulled else []))
    )
    attitude, exact = stepped(np.zeros(3), np.zeros(3), np.zeros(5))
    fourth_order = (np.linalg.norm(w) * step) ** 5
    off = Rotation.from_quat(after[:, 0], scalar_first=True) * attitude.inv()
    assert off.magnitude() < fourth_order
    assert rate[:, 0] == pytest.approx(exact, abs=fourth_order * np.linalg.norm(w))
    small = 1e-6
    for k in range(11):
        changes = [np.split(sign * small * np.eye(11)[k], [3, 6]) for sign in (1, -1)]
        (one, up), (other, down) = (stepped(*change) for change in changes)
        column = np.concatenate([(one * other.inv()).as_rotvec(), up - down]) / (2 * small)
        assert jacobian[:, k] == pytest.approx(column, abs=1e-5 * max(1, np.abs(column).max()))
