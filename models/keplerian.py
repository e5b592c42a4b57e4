"""The target's orbit as CasADi expressions: elements, ellipse, position and rates, Kepler's equation."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

import casadi as ca

from baryscope.models.frames import Symbol, quaternion_I_P, rotation_I_P

PARAMETERS = (
    "orbit.semiMajorAxis",
    "orbit.eccentricity",
    "orbit.inclination",
    "orbit.raan",
    "orbit.argumentOfPeriapsis",
    "orbit.trueAnomaly0",
    "orbit.gravitationalParameter",
)  # names of the elements in the unit, in the order of the table of variables
ELEMENT_COUNT = len(PARAMETERS)
CIRCULAR = 1e-9  # an eccentricity, or sine of an inclination, below which the direction it defines is arbitrary


@dataclass(frozen=True)
class Elements:
    """Keplerian elements at time 0, SI: the symbols for the fields of `baryscope.models.orbit.Orbit`.

    Attributes:
        semi_major_axis: a, m.
        eccentricity: e.
        inclination: rad.
        raan: right ascension of the ascending node, rad.
        argument_of_periapsis: rad.
        true_anomaly: at time 0, rad.
        gravitational_parameter: μ, m³/s².
    """

    semi_major_axis: Symbol
    eccentricity: Symbol
    inclination: Symbol
    raan: Symbol
    argument_of_periapsis: Symbol
    true_anomaly: Symbol
    gravitational_parameter: Symbol

    @classmethod
    def of(cls, column: Symbol) -> Self:
        """From a column of seven in the order of the fields, that of `Orbit.elements`."""
        return cls(*ca.vertsplit(column))

    @classmethod
    def symbols(cls) -> tuple[Symbol, Self]:
        """A new column of seven symbols, for the input of a function, and the elements in it."""
        column = ca.SX.sym("elements", ELEMENT_COUNT)
        return column, cls.of(column)

    @classmethod
    def named(cls, parameters: Mapping[str, Symbol]) -> Self:
        """From the unit's parameters, by their names in the table of variables."""
        return cls(*(parameters[name] for name in PARAMETERS))

    @property
    def column(self) -> Symbol:
        """The column of `of`."""
        column: Symbol = ca.vertcat(*(getattr(self, field.name) for field in fields(self)))
        return column

    @property
    def ellipse(self) -> "Ellipse":
        """Semi-latus rectum, eccentricity and rate."""
        return Ellipse.of(self.semi_major_axis, self.eccentricity, self.gravitational_parameter)

    @property
    def R_I_P(self) -> Symbol:
        """R_I_P, from the perifocal axes (x to the periapsis, z orbit normal) to I."""
        return rotation_I_P(self.raan, self.inclination, self.argument_of_periapsis)

    @property
    def q_I_P(self) -> Symbol:
        """The quaternion of R_I_P."""
        return quaternion_I_P(self.raan, self.inclination, self.argument_of_periapsis)

    @property
    def mean_motion(self) -> Symbol:
        """n = √(μ/a³), rad/s."""
        return ca.sqrt(self.gravitational_parameter / self.semi_major_axis**3)


@dataclass(frozen=True)
class Ellipse:
    """Size and shape of an orbit, as its equations use them.

    Attributes:
        semi_latus_rectum: p = a (1 − e²), m.
        eccentricity: e.
        rate: √(μ/p³), rad/s.
    """

    semi_latus_rectum: Symbol
    eccentricity: Symbol
    rate: Symbol

    @classmethod
    def of(cls, semi_major_axis: Symbol, eccentricity: Symbol, mu: Symbol) -> Self:
        """From a in m, 0 ≤ e < 1 and μ in m³/s²."""
        p = semi_major_axis * (1 - eccentricity**2)
        return cls(p, eccentricity, ca.sqrt(mu / p**3))


@dataclass(frozen=True)
class Conic:
    """Position of the target on its orbit, and its rates.

    Attributes:
        radius: r = p / (1 + e cos θ), m.
        radial_rate: ṙ, m/s.
        anomaly_rate: θ̇ = h / r², rad/s.
        anomaly_acceleration: θ̈ = −2 ṙ θ̇ / r, rad/s².
        stiffness: μ / r³, 1/s².
    """

    radius: Symbol
    radial_rate: Symbol
    anomaly_rate: Symbol
    anomaly_acceleration: Symbol
    stiffness: Symbol


def conic(orbit: Ellipse, true_anomaly: Symbol) -> Conic:
    """Position and rates at a true anomaly, rad. All rates are √(μ/p³) times powers of p/r = 1 + e cos θ."""
    e, k = orbit.eccentricity, orbit.rate
    ratio, sine = 1 + e * ca.cos(true_anomaly), e * ca.sin(true_anomaly)
    rate = k * ratio**2
    return Conic(
        radius=orbit.semi_latus_rectum / ratio,
        radial_rate=orbit.semi_latus_rectum * k * sine,
        anomaly_rate=rate,
        anomaly_acceleration=-2 * k * sine * ratio * rate,
        stiffness=k * rate * ratio,
    )


def eccentric_anomaly(mean_anomaly: Symbol, eccentricity: Symbol) -> Symbol:
    """E in rad from Kepler's equation E − e sin E = M, for −π ≤ M ≤ π and 0 ≤ e < 1.

    Markley's method (1995): with a Padé approximant of sin E the equation is a cubic one, the root of which is E to
    4e-4 of itself; one step of fifth order leaves less of that than rounding does.
    """
    M, e = mean_anomaly, eccentricity
    E = _markleys_start(M, e)
    sine, cosine = e * ca.sin(E), e * ca.cos(E)
    residual, slope = E - sine - M, 1 - cosine
    step = -residual / slope
    step = -residual / (slope + step * sine / 2)
    step = -residual / (slope + step * (sine / 2 + step * cosine / 6))
    step = -residual / (slope + step * (sine / 2 + step * (cosine / 6 - step * sine / 24)))
    return E + step


def _markleys_start(M: Symbol, e: Symbol) -> Symbol:
    """The root of the cubic equation, in the symbols of Markley (1995)."""
    alpha = (3 * ca.pi**2 + 1.6 * ca.pi * (ca.pi - ca.fabs(M)) / (1 + e)) / (ca.pi**2 - 6)
    d = 3 * (1 - e) + alpha * e
    q = 2 * alpha * d * (1 - e) - M**2
    r = M * (3 * alpha * d * (d - 1 + e) + M**2)
    w = _cube_root(ca.fabs(r) + ca.sqrt(q**3 + r**2)) ** 2
    return (2 * r * w / (w * (w + q) + q**2) + M) / d


def _cube_root(x: Symbol) -> Symbol:
    """x^(1/3) to 1e-3 for x from 1e-6 to 1e3: x^(1/4) x^(1/16) x^(1/48), the last by a Padé approximant about 1.

    By square roots, which all platforms round alike: a library that calls pow asks for the glibc it was built with.
    """
    fourth = ca.sqrt(ca.sqrt(x))
    y = ca.sqrt(ca.sqrt(fourth))
    return fourth * y * (14 * y**2 + 35 * y + 5) / (5 * y**2 + 35 * y + 14)


def eccentric_anomaly_after(time: Symbol, elements: Elements) -> tuple[Symbol, Symbol]:
    """E(t) in rad, from −π to π, and the number of whole turns; t in s from the epoch of the elements."""
    e = elements.eccentricity
    theta0, turns0 = whole_turns(elements.true_anomaly)
    E0 = 2 * ca.atan2(ca.sqrt((1 - e) / (1 + e)) * ca.sin(theta0 / 2), ca.cos(theta0 / 2))
    M, turns = whole_turns(E0 - e * ca.sin(E0) + elements.mean_motion * time)
    return eccentric_anomaly(M, e), turns + turns0


def true_anomaly_after(time: Symbol, elements: Elements) -> Symbol:
    """θ(t) in rad, unwrapped; t in s from the epoch of the elements."""
    e = elements.eccentricity
    E, turns = eccentric_anomaly_after(time, elements)
    return 2 * ca.atan2(ca.sin(E / 2), ca.sqrt((1 - e) / (1 + e)) * ca.cos(E / 2)) + 2 * ca.pi * turns


def position_and_velocity(time: Symbol, elements: Elements) -> Symbol:
    """[r; v] (6,) from the centre in I, m and m/s; t in s from the epoch of the elements."""
    return at_anomaly(true_anomaly_after(time, elements), elements)


def at_anomaly(true_anomaly: Symbol, elements: Elements) -> Symbol:
    """[r; v] (6,) from the centre in I, m and m/s, at a true anomaly in rad (Vallado 2013, algorithm 10)."""
    ellipse, cosine, sine = elements.ellipse, ca.cos(true_anomaly), ca.sin(true_anomaly)
    radius = conic(ellipse, true_anomaly).radius
    speed = ellipse.semi_latus_rectum * ellipse.rate
    return ca.vertcat(
        radius * elements.R_I_P @ ca.vertcat(cosine, sine, 0),
        speed * elements.R_I_P @ ca.vertcat(-sine, ellipse.eccentricity + cosine, 0),
    )


def osculating(state: Symbol, mu: Symbol) -> Elements:
    """The elements of the ellipse through [r; v] (6,) in I, m and m/s, there and then (Vallado 2013, algorithm 9).

    The periapsis of a circular orbit is its ascending node, and the node of an equatorial one the x axis.
    """
    r, v = state[:3], state[3:]
    distance, normal = ca.norm_2(r), ca.cross(r, v)
    momentum = ca.norm_2(normal)
    normal = normal / momentum
    towards = ca.cross(v, normal * momentum) / mu - r / distance  # the periapsis, e long
    sine = ca.norm_2(normal[:2])
    raan = ca.if_else(sine > CIRCULAR, ca.atan2(normal[0], -normal[1]), 0)
    node = ca.vertcat(ca.cos(raan), ca.sin(raan), 0)
    across = ca.cross(normal, node)
    x, y = ca.dot(towards, node), ca.dot(towards, across)
    e = ca.hypot(x, y)
    round_ = e < CIRCULAR
    periapsis = ca.if_else(round_, 0, ca.atan2(y, x))
    return Elements(
        semi_major_axis=1 / (2 / distance - ca.dot(v, v) / mu),
        eccentricity=ca.if_else(round_, 0, e),
        inclination=ca.atan2(sine, normal[2]),
        raan=raan,
        argument_of_periapsis=periapsis,
        true_anomaly=ca.atan2(ca.dot(r, across), ca.dot(r, node)) - periapsis,
        gravitational_parameter=mu,
    )


def whole_turns(angle: Symbol) -> tuple[Symbol, Symbol]:
    """An angle in rad as one from −π to π and a number of whole turns."""
    turns = ca.floor((angle + ca.pi) / (2 * ca.pi))
    return angle - 2 * ca.pi * turns, turns
