"""The target's own orbit: the conic, its rates, and Kepler's equation, as CasADi expressions."""

from dataclasses import dataclass
from typing import Self

import casadi as ca

from baryscope.models.frames import Symbol

KEPLER_ITERATIONS = 8


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


def mean_motion(semi_major_axis: Symbol, mu: Symbol) -> Symbol:
    """n = √(μ/a³), rad/s."""
    return ca.sqrt(mu / semi_major_axis**3)


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


def eccentric_anomaly_after(
    time: Symbol, semi_major_axis: Symbol, eccentricity: Symbol, mu: Symbol, true_anomaly0: Symbol
) -> tuple[Symbol, Symbol]:
    """E(t) in rad, from −π to π, and the number of whole turns beside it, from θ(0)."""
    e = eccentricity
    theta0, turns0 = whole_turns(true_anomaly0)
    E0 = 2 * ca.atan2(ca.sqrt((1 - e) / (1 + e)) * ca.sin(theta0 / 2), ca.cos(theta0 / 2))
    M, turns = whole_turns(E0 - e * ca.sin(E0) + mean_motion(semi_major_axis, mu) * time)
    return eccentric_anomaly(M, e), turns + turns0


def true_anomaly_after(
    time: Symbol, semi_major_axis: Symbol, eccentricity: Symbol, mu: Symbol, true_anomaly0: Symbol
) -> Symbol:
    """θ(t) in rad, unwrapped, from θ(0)."""
    e = eccentricity
    E, turns = eccentric_anomaly_after(time, semi_major_axis, e, mu, true_anomaly0)
    return 2 * ca.atan2(ca.sin(E / 2), ca.sqrt((1 - e) / (1 + e)) * ca.cos(E / 2)) + 2 * ca.pi * turns


def whole_turns(angle: Symbol) -> tuple[Symbol, Symbol]:
    """An angle in rad as one from −π to π and a number of whole turns."""
    turns = ca.floor((angle + ca.pi) / (2 * ca.pi))
    return angle - 2 * ca.pi * turns, turns
