"""The target's own orbit: its elements, the conic, its rates, and Kepler's equation, as CasADi expressions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import casadi as ca

from baryscope.models.frames import Symbol, rotation_I_P

KEPLER_ITERATIONS = 8

PARAMETERS = (
    "orbit.semiMajorAxis",
    "orbit.eccentricity",
    "orbit.inclination",
    "orbit.raan",
    "orbit.argumentOfPeriapsis",
    "orbit.trueAnomaly0",
    "orbit.gravitationalParameter",
)  # what the unit calls the elements, in the order of its table of variables
ELEMENT_COUNT = len(PARAMETERS)


@dataclass(frozen=True)
class Elements:
    """Keplerian elements at time 0, SI: the symbolic twin of `baryscope.models.orbit.Orbit`, field by field.

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
        """From a column of seven, in the order of the fields; `Orbit.elements` is its value."""
        return cls(*ca.vertsplit(column))

    @classmethod
    def symbols(cls) -> tuple[Symbol, Self]:
        """A new column of seven symbols, an input for functions, and the elements in it."""
        column = ca.SX.sym("elements", ELEMENT_COUNT)
        return column, cls.of(column)

    @classmethod
    def named(cls, parameters: Mapping[str, Symbol]) -> Self:
        """From the unit's parameters, by their names in the table of variables."""
        return cls(*(parameters[name] for name in PARAMETERS))

    @property
    def ellipse(self) -> "Ellipse":
        """Size and pace of the orbit."""
        return Ellipse.of(self.semi_major_axis, self.eccentricity, self.gravitational_parameter)

    @property
    def R_I_P(self) -> Symbol:
        """Attitude of the perifocal axes."""
        return rotation_I_P(self.raan, self.inclination, self.argument_of_periapsis)

    @property
    def mean_motion(self) -> Symbol:
        """n = √(μ/a³), rad/s."""
        return ca.sqrt(self.gravitational_parameter / self.semi_major_axis**3)


@dataclass(frozen=True)
class Ellipse:
    """The size of an orbit, in the numbers that its equations need.

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
    """Where the target is on its orbit and how fast that changes.

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
    """The place on the ellipse at a true anomaly, rad; all rates are √(μ/p³) times powers of p/r = 1 + e cos θ."""
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
    """E in rad from Kepler's equation E − e sin E = M, for −π ≤ M ≤ π.

    Start and steps are Danby's (1988): from E = M + 0.85 e sign(sin M), in steps of fourth order, of which a fixed
    number suffices for every e up to 0.999.
    """
    M, e = mean_anomaly, eccentricity
    E = M + 0.85 * e * ca.sign(ca.sin(M))
    for _ in range(KEPLER_ITERATIONS):
        sine, cosine = e * ca.sin(E), e * ca.cos(E)
        fault, slope = E - sine - M, 1 - cosine
        second = -fault / slope
        third = -fault / (slope + second * sine / 2)
        E = E - fault / (slope + third * sine / 2 + third**2 * cosine / 6)
    return E


def eccentric_anomaly_after(time: Symbol, elements: Elements) -> tuple[Symbol, Symbol]:
    """E(t) in rad, from −π to π, and the number of whole turns beside it, t in s after the elements' time."""
    e = elements.eccentricity
    theta0, turns0 = whole_turns(elements.true_anomaly)
    E0 = 2 * ca.atan2(ca.sqrt((1 - e) / (1 + e)) * ca.sin(theta0 / 2), ca.cos(theta0 / 2))
    M, turns = whole_turns(E0 - e * ca.sin(E0) + elements.mean_motion * time)
    return eccentric_anomaly(M, e), turns + turns0


def true_anomaly_after(time: Symbol, elements: Elements) -> Symbol:
    """θ(t) in rad, unwrapped, t in s after the elements' time."""
    e = elements.eccentricity
    E, turns = eccentric_anomaly_after(time, elements)
    return 2 * ca.atan2(ca.sin(E / 2), ca.sqrt((1 - e) / (1 + e)) * ca.cos(E / 2)) + 2 * ca.pi * turns


def whole_turns(angle: Symbol) -> tuple[Symbol, Symbol]:
    """An angle in rad as one from −π to π and a number of whole turns."""
    turns = ca.floor((angle + ca.pi) / (2 * ca.pi))
    return angle - 2 * ca.pi * turns, turns
