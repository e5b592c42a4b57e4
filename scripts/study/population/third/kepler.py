"""Two-body motion in closed form."""

import numpy as np

from baryscope.models.orbit import Orbit
from baryscope.study.population.interface import FloatArray


def at_epoch(orbit: Orbit) -> FloatArray:
    """Position and velocity (6,) in inertial axes at time 0, m and m/s."""
    e, nu = orbit.eccentricity, orbit.true_anomaly
    parameter = orbit.semi_major_axis * (1 - e**2)
    in_plane = parameter / (1 + e * np.cos(nu)) * np.array([np.cos(nu), np.sin(nu), 0.0])
    velocity = np.sqrt(orbit.gravitational_parameter / parameter) * np.array([-np.sin(nu), e + np.cos(nu), 0.0])
    R = _about_z(orbit.raan) @ _about_x(orbit.inclination) @ _about_z(orbit.argument_of_periapsis)
    return np.concatenate([R @ in_plane, R @ velocity])


def propagated(state: FloatArray, mu: float, elapsed: FloatArray) -> FloatArray:
    """States (n, 6) at times (n,) s after that of a state (6,) of an ellipse, by the change of eccentric anomaly."""
    r, v = state[:3], state[3:]
    distance = float(np.linalg.norm(r))
    a = 1 / (2 / distance - v @ v / mu)
    cosine, sine = 1 - distance / a, r @ v / np.sqrt(mu * a)  # e cos E, e sin E at the start
    turned = np.sqrt(mu / a**3) * elapsed
    x = turned.copy()
    for _ in range(40):
        residual = x - cosine * np.sin(x) + sine * (1 - np.cos(x)) - turned
        step = residual / (1 - cosine * np.cos(x) + sine * np.sin(x))
        x = x - np.clip(step, -1.0, 1.0)
    radius = a * (1 - cosine * np.cos(x) + sine * np.sin(x))
    f = 1 - a / distance * (1 - np.cos(x))
    g = elapsed - (x - np.sin(x)) * np.sqrt(a**3 / mu)
    f_rate = -np.sqrt(mu * a) / (radius * distance) * np.sin(x)
    g_rate = 1 - a / radius * (1 - np.cos(x))
    return np.concatenate([f[:, None] * r + g[:, None] * v, f_rate[:, None] * r + g_rate[:, None] * v], axis=1)


def _about_z(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_x(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
