"""Kepler orbits of the target: in closed form, and drawn."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.study.population.second.chance import TURN

FloatArray = NDArray[np.float64]

MU = 3.986004418e14  # m³/s², the Earth's
EARTH = 6378137.0  # m


@dataclass(frozen=True)
class Elements:
    """Semi-major axis a in m, eccentricity, and angles in rad; mean0: the mean anomaly at time 0."""

    a: float
    e: float
    i: float
    raan: float
    argp: float
    mean0: float

    @cached_property
    def n(self) -> float:
        """The mean motion, rad/s."""
        return float(np.sqrt(MU / self.a**3))

    @cached_property
    def minor(self) -> float:
        """The semi-minor axis, m."""
        return float(self.a * np.sqrt(1 - self.e**2))

    @cached_property
    def axes(self) -> FloatArray:
        """Unit vectors (2, 3) in I towards periapsis, and across it in the plane."""
        co, so, ci, si = np.cos(self.raan), np.sin(self.raan), np.cos(self.i), np.sin(self.i)
        cw, sw = np.cos(self.argp), np.sin(self.argp)
        return np.array(
            [
                [co * cw - so * sw * ci, so * cw + co * sw * ci, sw * si],
                [-co * sw - so * cw * ci, -so * sw + co * cw * ci, cw * si],
            ]
        )

    def eccentric(self, t: float) -> float:
        """The eccentric anomaly at time t in s, rad, by Newton's steps in Kepler's equation."""
        mean = self.mean0 + self.n * t
        m = mean - np.floor((mean + np.pi) / TURN) * TURN
        anomaly = m + self.e * np.sin(m)
        for _ in range(60):
            step = (anomaly - self.e * np.sin(anomaly) - m) / (1 - self.e * np.cos(anomaly))
            anomaly = anomaly - min(max(step, -1), 1)
            if abs(step) < 1e-15:
                break
        return float(anomaly)

    def position(self, t: float) -> FloatArray:
        """The place (3,) in I at time t in s, m."""
        anomaly, (p, q) = self.eccentric(t), self.axes
        return np.asarray(self.a * (np.cos(anomaly) - self.e) * p + self.minor * np.sin(anomaly) * q)

    def velocity(self, t: float) -> FloatArray:
        """The velocity (3,) in I at time t in s, m/s."""
        anomaly, (p, q) = self.eccentric(t), self.axes
        rate = self.n / (1 - self.e * np.cos(anomaly))
        return np.asarray(-self.a * np.sin(anomaly) * rate * p + self.minor * np.cos(anomaly) * rate * q)

    def true_anomaly(self, t: float) -> float:
        """The true anomaly at time t in s, rad."""
        anomaly = self.eccentric(t)
        return float(np.arctan2(np.sqrt(1 - self.e**2) * np.sin(anomaly), np.cos(anomaly) - self.e))


def mean_of_true(true: float, e: float) -> float:
    """The mean anomaly of a true one at eccentricity e, both in rad."""
    anomaly = np.arctan2(np.sqrt(1 - e * e) * np.sin(true), e + np.cos(true))
    return float(anomaly - e * np.sin(anomaly))


def lvlh(r: FloatArray, v: FloatArray) -> tuple[FloatArray, float]:
    """R_I_L (3, 3), whose columns are radial, along the track and normal, and its rate of turn about the last, rad/s.

    r, v (3,): the target's place and velocity in I, m and m/s.
    """
    h = np.cross(r, v)
    x, z = r / np.linalg.norm(r), h / np.linalg.norm(h)
    return np.column_stack([x, np.cross(z, x), z]), float(np.linalg.norm(h) / (r @ r))


def draw_orbit(rng: np.random.Generator, start: float) -> tuple[Elements, str]:
    """An orbit on which the target is anywhere at time `start` in s, and its words."""
    kind = rng.choice(["LEO", "MEO", "GEO", "GTO", "ellipse"], p=[0.46, 0.06, 0.16, 0.12, 0.2])
    inclination = rng.choice([np.deg2rad(rng.normal(98, 2)), np.deg2rad(rng.uniform(0, 105)), np.deg2rad(51.6)])
    if kind == "LEO":
        perigee, e = EARTH + rng.uniform(350e3, 1400e3), min(abs(rng.normal(0, 0.006)), 0.03)
    elif kind == "MEO":
        perigee, e = rng.uniform(16e6, 30e6), rng.uniform(0, 0.02)
    elif kind == "GEO":  # or 300 km above it
        a, e = 42164e3 + rng.choice([0.0, 300e3]) + rng.normal(0, 20e3), rng.uniform(0, 0.01)
        perigee, inclination = a * (1 - e), np.deg2rad(abs(rng.normal(0, 6)))
    elif kind == "GTO":
        e = rng.uniform(0.6, 0.7)
        perigee = EARTH + rng.uniform(200e3, 1500e3)
        inclination = np.deg2rad(rng.choice([7.0, 28.5, rng.uniform(0, 60)]))
    else:
        perigee, e = EARTH + rng.uniform(300e3, 4000e3), rng.uniform(0.02, 0.7)
    a = perigee / (1 - e)
    even = rng.random() < 0.5  # in time, or in the true anomaly
    anomaly = rng.uniform(-np.pi, np.pi)
    mean = anomaly if even else mean_of_true(anomaly, e)
    n = np.sqrt(MU / a**3)
    node, argument = rng.uniform(0, TURN), rng.uniform(0, TURN)
    elements = Elements(float(a), float(e), float(inclination), node, argument, float((mean - n * start) % TURN))
    return elements, f"{kind} a={a / 1e3:.0f}km e={e:.3f}"
