"""The target's own orbit: the conic, its rates, and Kepler's equation, as CasADi expressions."""

from dataclasses import dataclass
from typing import Self

import casadi as ca

from baryscope.models.frames import Symbol

KEPLER_ITERATIONS = 16


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


def true_anomaly_after(
    time: Symbol, semi_major_axis: Symbol, eccentricity: Symbol, mu: Symbol, true_anomaly0: Symbol
) -> Symbol:
    """θ(t) in rad, unwrapped, from θ(0), by Newton's iteration on Kepler's equation E − e sin E = M.

    The iteration starts at E = M + 0.85 e sign(sin M) (Danby 1988), from where a fixed number of steps
    suffices for every e below 1.
    """
    e = eccentricity
    to_eccentric = ca.sqrt((1 - e) / (1 + e))

    turns0 = ca.floor((true_anomaly0 + ca.pi) / (2 * ca.pi))
    theta0 = true_anomaly0 - 2 * ca.pi * turns0
    E0 = 2 * ca.atan2(to_eccentric * ca.sin(theta0 / 2), ca.cos(theta0 / 2))
    M = E0 - e * ca.sin(E0) + mean_motion(semi_major_axis, mu) * time
    turns = ca.floor((M + ca.pi) / (2 * ca.pi))
    M = M - 2 * ca.pi * turns
    E = M + 0.85 * e * ca.sign(ca.sin(M))
    for _ in range(KEPLER_ITERATIONS):
        E = E - (E - e * ca.sin(E) - M) / (1 - e * ca.cos(E))
    theta = 2 * ca.atan2(ca.sin(E / 2), to_eccentric * ca.cos(E / 2))
    return theta + 2 * ca.pi * (turns + turns0)
