"""A world with all forces, written down once more with plain numpy: both bodies in inertial axes."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import oracles
from baryscope.models.scenario import Drag, EddyCurrents, Light

J2, RADIUS = 1.08262668e-3, 6378137.0
DRAG = Drag(density=4e-12, target=0.01, chaser=0.025, scale_height=6e4)
LIGHT = Light(sun=(-1.0, 0.4, 0.2), target=0.03, chaser=0.01)
EDDY = EddyCurrents(tensor=((2e6, 0.0, 1e5), (0.0, 1e6, 2e5), (1e5, 2e5, 3e6)))


def acceleration(scenario, r, v, body):
    """Of the target or the chaser at a place and velocity, as the scenario says, m/s²."""
    orbit, distance = scenario.orbit, np.linalg.norm(r)
    mu, up = orbit.gravitational_parameter, r / np.linalg.norm(r)
    total = -mu * r / distance**3
    if orbit.j2 is not None:
        s = up[2]
        # Vallado, Fundamentals of Astrodynamics, (8-30): by components.
        total += (
            -1.5 * orbit.j2 * mu * orbit.equatorial_radius**2 / distance**4
            * np.array([up[0] * (1 - 5 * s * s), up[1] * (1 - 5 * s * s), up[2] * (3 - 5 * s * s)])
        )  # fmt: skip
    if scenario.drag is not None:
        air = scenario.drag
        height = distance - (air.reference_radius or orbit.semi_major_axis)
        wind = v - air.rotation_rate * np.array([-r[1], r[0], 0.0])
        b = getattr(air, body)
        total += -0.5 * air.density * np.exp(-height / air.scale_height) * b * np.linalg.norm(wind) * wind
    if scenario.light is not None:
        total += (
            -lit(r, scenario.light)
            * scenario.light.pressure
            * getattr(scenario.light, body)
            * np.array(scenario.light.sun)
        )
    return total


def lit(r, light):
    """The share of the Sun's disc seen over a straight limb, by angles from arccos."""
    distance = np.linalg.norm(r)
    x = (np.arccos(-r @ np.array(light.sun) / distance) - np.arcsin(light.shadow_radius / distance)) / 4.6505e-3
    x = min(1.0, max(-1.0, x))
    return 1 - (np.arccos(x) - x * np.sqrt(1 - x * x)) / np.pi


def torque_B(scenario, r, v, R_I_B, rate):
    """Gravity gradient and eddy currents, N m in B."""
    total = np.zeros(3)
    if scenario.target.gravity_gradient:
        up = R_I_B.T @ r / np.linalg.norm(r)
        total += (
            3
            * scenario.orbit.gravitational_parameter
            / np.linalg.norm(r) ** 3
            * oracles.cross(up, np.array(scenario.target.inertia) @ up)
        )
    if scenario.eddy_currents is not None:
        m = np.array(scenario.eddy_currents.dipole)

        def field(place):
            square = place @ place
            return (3 * (m @ place) * place - m * square) / square**2.5

        B, h = R_I_B.T @ field(r), 1.0
        B_dot = R_I_B.T @ (field(r + h * v) - field(r - h * v)) / (2 * h)
        total += oracles.cross(np.array(scenario.eddy_currents.tensor) @ (oracles.cross(rate, B) - B_dot), B)
    return total


def fly(scenario, time):
    """Target's position and velocity, the CoM from the chaser, and attitude (w, x, y, z), at each time."""
    J = np.array(scenario.target.inertia)
    target, chaser = start(scenario)

    def rates(_, state):
        r, v, r_c, v_c = state[:12].reshape(4, 3)
        q, w = state[12:16], state[16:]
        R_I_B = Rotation.from_quat(q, scalar_first=True).as_matrix()
        q_dot = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + oracles.cross(q[1:], w))])
        w_dot = np.linalg.solve(J, torque_B(scenario, r, v, R_I_B, w) - oracles.cross(w, J @ w))
        return np.concatenate(
            [v, acceleration(scenario, r, v, "target"), v_c, acceleration(scenario, r_c, v_c, "chaser"), q_dot, w_dot]
        )

    first = np.concatenate([*target, *chaser, scenario.target.attitude, np.deg2rad(scenario.target.angular_rate_deg)])
    first[12:16] /= np.linalg.norm(first[12:16])
    # Places of 7e6 m are good to 1e-9 m in a step: a finer tolerance gains nothing.
    solution = solve_ivp(rates, (0, time[-1]), first, "DOP853", time, rtol=3e-14, atol=1e-12, max_step=20.0)
    r, v, r_c, q = solution.y[:3].T, solution.y[3:6].T, solution.y[6:9].T, solution.y[12:16].T
    return r, v, r - r_c, q


def fly_paths(scenario, time):
    """The target's position and the CoM from the chaser at each time, without the attitude, on which no force hangs."""
    target, chaser = start(scenario)

    def rates(_, state):
        r, v, r_c, v_c = state.reshape(4, 3)
        return np.concatenate(
            [v, acceleration(scenario, r, v, "target"), v_c, acceleration(scenario, r_c, v_c, "chaser")]
        )

    first = np.concatenate([*target, *chaser])
    solution = solve_ivp(rates, (0, time[-1]), first, "DOP853", time, rtol=1e-12, atol=1e-9)  # 7e-6 m in a step
    return solution.y[:3].T, (solution.y[:3] - solution.y[6:9]).T


def start(scenario):
    """Inertial states of both at time 0; LVLH also turns about the radius, by the force across the orbit's plane."""
    position, velocity = scenario.chaser.position, scenario.chaser.velocity
    (r, v), _ = oracles.inertial_states(scenario.orbit, position, velocity)
    normal = np.cross(r, v)
    h = np.linalg.norm(normal)
    R_I_L = np.column_stack([r / np.linalg.norm(r), np.cross(normal / h, r / np.linalg.norm(r)), normal / h])
    across = acceleration(scenario, r, v, "target") @ normal / h
    spin = np.array([np.linalg.norm(r) / h * across, 0.0, h / (r @ r)])
    return (r, v), (r + R_I_L @ position, v + R_I_L @ (np.array(velocity) + np.cross(spin, position)))
