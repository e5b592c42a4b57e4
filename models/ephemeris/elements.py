"""Keplerian elements from position and velocity."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CIRCULAR = 1e-9  # an eccentricity, or sine of an inclination, below which the direction it defines is arbitrary


def elements_of(state: FloatArray, mu: float) -> dict[str, float]:
    """The osculating elements, by the names of the fields of `Orbit`, in m and rad (Vallado 2013, algorithm 9).

    The periapsis of a circular orbit is its ascending node, and the node of an equatorial one the x axis.

    Args:
        state: (6,), position and velocity from the central body's centre in I, m and m/s.
        mu: gravitational parameter, m³/s².
    """
    r, v = state[:3], state[3:]
    distance = float(np.linalg.norm(r))
    normal = _cross(r, v)
    momentum = float(np.linalg.norm(normal))
    normal = normal / momentum
    towards = _cross(v, normal * momentum) / mu - r / distance
    e = float(np.linalg.norm(towards))
    node = np.array([-normal[1], normal[0], 0.0])
    sine = float(np.linalg.norm(node))
    node = node / sine if sine > CIRCULAR else np.array([1.0, 0.0, 0.0])
    periapsis = towards / e if e > CIRCULAR else node
    return {
        "semi_major_axis": 1 / (2 / distance - float(v @ v) / mu),
        "eccentricity": e if e > CIRCULAR else 0.0,
        "inclination": float(np.arctan2(sine, normal[2])),
        "raan": float(np.arctan2(node[1], node[0])),
        "argument_of_periapsis": _angle(node, periapsis, normal),
        "true_anomaly": _angle(periapsis, r / distance, normal),
    }


def _angle(begin: FloatArray, end: FloatArray, axis: FloatArray) -> float:
    """From one unit vector to another about an axis normal to both, rad."""
    return float(np.arctan2(_cross(begin, end) @ axis, begin @ end))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a × b of two vectors (3,): the same numbers as NumPy's, whose time goes to what does not depend on them."""
    x, y, z = a.tolist()
    p, q, r = b.tolist()
    return np.array([y * r - z * q, z * p - x * r, x * q - y * p])
