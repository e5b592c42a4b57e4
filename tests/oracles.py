"""Solutions that don't use baryscope's equations: two-body orbits in closed form, tight integrations by scipy."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation


def propagate_kepler(r0, v0, mu, time):
    """Position and velocity on a Kepler orbit after `time`, by Lagrange's f and g (Battin 1999, §4.3)."""
    r0, v0 = np.asarray(r0, dtype=np.longdouble), np.asarray(v0, dtype=np.longdouble)
    mu, time = np.longdouble(mu), np.longdouble(time)
    radius = np.sqrt(r0 @ r0)
    a = 1 / (2 / radius - v0 @ v0 / mu)
    n = np.sqrt(mu / a**3)
    sigma = r0 @ v0 / np.sqrt(mu * a)

    def fault(dE):
        return dE - (1 - radius / a) * np.sin(dE) + sigma * (1 - np.cos(dE)) - n * time

    guess = float(n * time)
    dE = np.longdouble(brentq(lambda E: float(fault(np.longdouble(E))), guess - 4, guess + 4, xtol=1e-12))
    for _ in range(3):  # Newton, in extended precision
        dE -= fault(dE) / (1 - (1 - radius / a) * np.cos(dE) + sigma * np.sin(dE))
    s, c = np.sin(dE), np.cos(dE)
    f, g = 1 - a / radius * (1 - c), time - (dE - s) / n
    r = f * r0 + g * v0
    distance = np.sqrt(r @ r)
    v = -np.sqrt(mu * a) / (distance * radius) * s * r0 + (1 - a / distance * (1 - c)) * v0
    return r, v


def inertial_states(orbit, chaser_position_L, chaser_velocity_L):
    """Inertial position and velocity of target and chaser at time 0, from elements and the LVLH state."""
    R_I_P = Rotation.from_euler(
        "ZXZ", [orbit.raan_deg, orbit.inclination_deg, orbit.argument_of_periapsis_deg], degrees=True
    ).as_matrix()
    theta, e, mu = np.deg2rad(orbit.true_anomaly_deg), orbit.eccentricity, orbit.gravitational_parameter
    p = orbit.semi_major_axis * (1 - e**2)
    up = R_I_P @ [np.cos(theta), np.sin(theta), 0]
    r = p / (1 + e * np.cos(theta)) * up
    v = np.sqrt(mu / p) * (R_I_P @ [-np.sin(theta), e + np.cos(theta), 0])
    normal = np.cross(r, v)
    R_I_L = np.column_stack([up, np.cross(normal / np.linalg.norm(normal), up), normal / np.linalg.norm(normal)])
    spin = normal / (r @ r)
    offset = R_I_L @ np.asarray(chaser_position_L)
    return (r, v), (r + offset, v + R_I_L @ np.asarray(chaser_velocity_L) + np.cross(spin, offset))


def com_in_chaser_frame(scenario, time):
    """The target's CoM in frame C at each time: the difference of two Kepler orbits."""
    target, chaser = inertial_states(scenario.orbit, scenario.chaser.position, scenario.chaser.velocity)
    mu = scenario.orbit.gravitational_parameter
    return np.array(
        [propagate_kepler(*target, mu, t)[0] - propagate_kepler(*chaser, mu, t)[0] for t in time], dtype=float
    )


def torque_free_attitude(scenario, time):
    """Attitude quaternions (w, x, y, z) at each time, by scipy's DOP853 at 1e-13 on plain numpy equations."""
    J = np.array(scenario.target.inertia)
    J_inverse = np.linalg.inv(J)

    def rates(_, state):
        w, x, y, z = state[:4]
        omega = state[4:]
        a, b, c = omega
        q_dot = 0.5 * np.array(
            [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
        )
        return np.concatenate([q_dot, J_inverse @ -np.cross(omega, J @ omega)])

    start = np.concatenate([scenario.target.attitude, np.deg2rad(scenario.target.angular_rate_deg)])
    solution = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-15)
    return solution.y[:4].T


def angle_between(q, p):
    """Angle of the rotation between two quaternions (w, x, y, z), rad, good to 1e-15 for small angles."""
    R_q, R_p = (Rotation.from_quat(a, scalar_first=True) for a in (q, p))
    return (R_q.inv() * R_p).magnitude()
