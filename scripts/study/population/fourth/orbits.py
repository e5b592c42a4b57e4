"""The orbit of the target: drawn, and its states in two-body motion."""

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from baryscope.models.orbit import Orbit
from baryscope.study.population.fourth.chance import log_uniform
from baryscope.study.population.interface import FloatArray

MU = 3.986004418e14  # m³/s², the Earth's
J2, EQUATORIAL_RADIUS = 1.08262668e-3, 6378137.0  # m
GEOSTATIONARY = 42164e3  # m
OBLATE_SHARE, OBLATE_LONGEST, OBLATE_HIGHEST = 0.15, 6000.0, 1.2e7  # of cases up to that span, s, and periapsis, m


def drawn(rng: np.random.Generator) -> tuple[float, float, float, float, float, float]:
    """Semi-major axis in m, eccentricity, inclination, node, argument of periapsis and true anomaly at time 0, rad."""
    eccentricities = [0.0, rng.uniform(0, 0.01), rng.uniform(0.01, 0.3), rng.uniform(0.3, 0.7)]
    e = float(rng.choice(eccentricities, p=[0.12, 0.4, 0.24, 0.24]))
    if rng.random() < 0.4:
        periapsis = log_uniform(rng, 6378e3 + 300e3, GEOSTATIONARY)
    else:
        periapsis = rng.uniform(6378e3 + 350e3, 6378e3 + 1500e3)
    raan, argument, anomaly = rng.uniform(0, 2 * np.pi, 3).tolist()
    return periapsis / (1 - e), e, float(np.arccos(rng.uniform(-1, 1))), raan, argument, anomaly


def told(rng: np.random.Generator, elements: tuple[float, float, float, float, float, float], span: float) -> Orbit:
    """The orbit of `drawn` elements as an estimator is told it; its j2 is above 0 where the Earth is oblate.

    Half of the orbits about a point mass say so by a j2 of 0, half of all that they are exact. span: s.
    """
    a, e, *_ = elements
    accuracy = 0.0 if rng.random() < 0.5 else None
    oblate = rng.random() < OBLATE_SHARE and span < OBLATE_LONGEST and a * (1 - e) < OBLATE_HIGHEST
    if oblate or rng.random() < 0.5:
        j2 = J2 if oblate else 0.0
        return Orbit(*elements, MU, j2=j2, equatorial_radius=EQUATORIAL_RADIUS, accuracy=accuracy)
    return Orbit(*elements, MU, accuracy=accuracy)


def state(orbit: Orbit, time: float) -> FloatArray:
    """Position and velocity (6,) in I of a two-body orbit at a time, s, m and m/s."""
    a, e = orbit.semi_major_axis, orbit.eccentricity
    narrow = np.sqrt(1 - e**2)
    start = np.arctan2(narrow * np.sin(orbit.true_anomaly), e + np.cos(orbit.true_anomaly))
    mean_motion = np.sqrt(MU / a**3)
    mean = np.remainder(start - e * np.sin(start) + mean_motion * time, 2 * np.pi)
    E = brentq(lambda x: x - e * np.sin(x) - mean, -1, 2 * np.pi + 1, xtol=1e-15, rtol=1e-15)
    c, s = np.cos(E), np.sin(E)
    angles = [orbit.raan, orbit.inclination, orbit.argument_of_periapsis]
    R = Rotation.from_euler("ZXZ", angles).as_matrix()
    position = a * np.array([c - e, narrow * s, 0])
    velocity = a * mean_motion / (1 - e * c) * np.array([-s, narrow * c, 0])
    return np.concatenate([R @ position, R @ velocity])


def lvlh(target: FloatArray) -> FloatArray:
    """R_I_L (3, 3), whose columns are radial, along the track and normal, of a state (6,) in I."""
    r, v = target[:3], target[3:]
    x, h = r / np.linalg.norm(r), np.cross(r, v)
    z = h / np.linalg.norm(h)
    return np.column_stack([x, np.cross(z, x), z])
