"""The equations of relative motion against the difference of two Kepler orbits."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import oracles
from baryscope.models.keplerian import Ellipse, conic
from baryscope.models.relative_motion import relative_acceleration
from baryscope.models.scenario import load_scenario
from baryscope.models.target import tumbling_target

MU = 3.986004418e14
POSITION_TOLERANCE = 1e-6  # m over one orbit
VELOCITY_TOLERANCE = 1e-9  # m/s over one orbit
STARTS = [
    pytest.param((0.0, -20.0, 0.0), (0.0, 0.0, 0.0), id="v-bar"),
    pytest.param((10.0, 5.0, -3.0), (0.004, -0.018, 0.01), id="ellipse"),
]


def flown(scenario, samples=25, misprint=False):
    """Times, CoM and its velocity in C over one orbit; with `misprint`, by the paper's (4) as it stands."""
    system = tumbling_target(len(scenario.features.points))
    p, u = ca.DM(scenario.flat_parameters()), ca.DM.zeros(6)
    time = np.linspace(0, 60.0 if misprint else scenario.orbit.period, samples)
    elements = [ca.DM(value) for value in (scenario.orbit.semi_major_axis, scenario.orbit.eccentricity, MU)]

    def rates(_, x):
        rate = np.array(system.rhs(x, u, p)).ravel()
        if misprint:
            theta_dot = float(ca.evalf(conic(Ellipse.of(*elements), ca.DM(x[7])).anomaly_rate))
            rate[11:13] += (theta_dot - theta_dot**2) * x[8:10]
        return rate

    start = np.array(system.initial(p)).ravel()
    solution = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-13)
    outputs = np.array(system.outputs.map(samples)(solution.y, p)).T
    names = [name for v in system.of_kind("output") for name in v.scalar_names]
    first = names.index("target.position[1]")
    return time, outputs[:, first : first + 3], outputs[:, first + 3 : first + 6]


def scenario_with(eccentricity, inclination_deg, position, velocity):
    """Envisat at rest in I, so that only the relative motion is integrated."""
    envisat = load_scenario("envisat")
    orbit = replace(
        envisat.orbit,
        semi_major_axis=9.0e6,
        eccentricity=eccentricity,
        inclination=np.deg2rad(inclination_deg),
        true_anomaly=0.7,
    )
    return envisat.model_copy(
        update={
            "orbit": orbit,
            "chaser": envisat.chaser.model_copy(update={"position": position, "velocity": velocity}),
            "target": envisat.target.model_copy(update={"angular_rate_deg": (0.0, 0.0, 0.0)}),
        }
    )


@pytest.mark.parametrize("position, velocity", STARTS)
@pytest.mark.parametrize("inclination_deg", [0.0, 51.6, 98.55])
@pytest.mark.parametrize("eccentricity", [0.0, 0.05, 0.1, 0.2])
def test_one_orbit_is_the_difference_of_two_kepler_orbits(eccentricity, inclination_deg, position, velocity):
    scenario = scenario_with(eccentricity, inclination_deg, position, velocity)
    time, position_C, velocity_C = flown(scenario)
    target, chaser = oracles.inertial_states(scenario.orbit, position, velocity)
    states = [(oracles.propagate_kepler(*target, MU, t), oracles.propagate_kepler(*chaser, MU, t)) for t in time]
    expected_position = np.array([a[0] - b[0] for a, b in states], dtype=float)
    expected_velocity = np.array([a[1] - b[1] for a, b in states], dtype=float)
    assert np.abs(position_C - expected_position).max() < POSITION_TOLERANCE
    assert np.abs(velocity_C - expected_velocity).max() < VELOCITY_TOLERANCE


def test_the_papers_equation_as_printed_is_wrong():
    """With θ̇ρ in place of θ̇²ρ the hold is left by tens of metres within a minute."""
    scenario = scenario_with(0.1, 98.55, (0.0, -20.0, 0.0), (0.0, 0.0, 0.0))
    time, printed, _ = flown(scenario, samples=7, misprint=True)
    assert np.linalg.norm(printed[-1] - oracles.com_in_chaser_frame(scenario, time)[-1]) > 10.0


@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    e=st.floats(0, 0.5),
    theta=st.floats(-4, 4),
)
def test_gravity_loses_no_digits_close_by(direction, e, theta):
    """At 1 mm the gravity difference is its gradient, μ/r³ (2x, −y, −z), but for 3/2 ρ/r ≈ 2e-10 of itself.

    Subtracting two gravities of 8 m/s² would leave 1e-15 of 1e-9 m/s²: six digits, against ten here.
    """
    here = conic(Ellipse.of(*map(ca.DM, (1.2e7, e, MU))), ca.DM(theta))
    rho = 1e-3 * np.array(direction) / np.linalg.norm(direction)
    rest, nothing = ca.DM.zeros(3), ca.DM.zeros(3)
    total = np.array(ca.evalf(relative_acceleration(ca.DM(rho), rest, nothing, here))).ravel()
    r, rate, rate_dot = (float(ca.evalf(x)) for x in (here.radius, here.anomaly_rate, here.anomaly_acceleration))
    x, y, z = rho
    gravity = total - [rate_dot * y + rate**2 * x, -rate_dot * x + rate**2 * y, 0]
    expected = MU / r**3 * np.array([2 * x, -y, -z])
    assert np.linalg.norm(gravity - expected) < 1e-9 * MU / r**3 * 1e-3


@given(thrust=st.tuples(*[st.floats(-1, 1)] * 3))
def test_commanded_acceleration_adds(thrust):
    here = conic(Ellipse.of(*map(ca.DM, (7e6, 0.01, MU))), ca.DM(1.0))
    position, velocity = ca.DM([3.0, -20.0, 1.0]), ca.DM([0.01, 0.02, -0.01])
    coasting = ca.evalf(relative_acceleration(position, velocity, ca.DM.zeros(3), here))
    pushed = ca.evalf(relative_acceleration(position, velocity, ca.DM(thrust), here))
    np.testing.assert_allclose(np.array(pushed - coasting).ravel(), thrust, atol=1e-15)


def test_clohessy_wiltshire_ellipse_closes_on_a_circular_orbit():
    """ẏ0 = −2 n x0 is free of drift to first order; what is left is of second order, 6π ρ²/a = 3e-4 m at 12 m."""
    n = np.sqrt(MU / 9.0e6**3)
    x0, t = 10.0, np.linspace(0, 2 * np.pi / n, 25)
    scenario = scenario_with(0.0, 30.0, (x0, 0.0, 0.0), (0.0, -2 * n * x0, 0.0))
    system, p = tumbling_target(12), scenario.flat_parameters()
    start = np.array(system.initial(p)).ravel()
    solution = solve_ivp(
        oracles.slope_of(system.rhs, len(start), np.zeros(6), p), (0, t[-1]), start, "DOP853", t,
        rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    ellipse = np.array([x0 * np.cos(n * t), -2 * x0 * np.sin(n * t), 0 * t])
    assert np.abs(solution.y[8:11] - ellipse).max() < 1e-3
