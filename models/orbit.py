"""The target's orbit: Keplerian elements in SI units, as estimators and dynamics use it."""

from dataclasses import astuple, dataclass, fields
from functools import cache
from math import inf, isfinite, pi, sqrt

import numpy as np

from baryscope.models.checks import CheckSet, orbit_checks
from baryscope.models.errors import InputError
from baryscope.models.keplerian import PARAMETERS, Elements

EARTH_MU = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, WGS 84
RANGES = {
    "semi_major_axis": (1.0, 1e15, "m"),
    "gravitational_parameter": (1e-9, 1e30, "m³/s²"),
    "inclination": (-1e6, 1e6, "rad"),
    "raan": (-1e6, 1e6, "rad"),
    "argument_of_periapsis": (-1e6, 1e6, "rad"),
    "true_anomaly": (-1e6, 1e6, "rad"),
}  # wider than the solar system; an angle of 1e6 rad still has ten digits
MAX_RATE = 0.01  # rad/s at periapsis: a higher rate needs a central body over fifty times as dense as rock


@dataclass(frozen=True)
class Orbit:
    """Keplerian elements at time 0, inertial axes, angles in rad.

    Attributes:
        semi_major_axis: m, above 0.
        eccentricity: from 0 to below 1.
        inclination: rad.
        raan: right ascension of the ascending node, rad.
        argument_of_periapsis: rad.
        true_anomaly: at time 0, rad, any number of turns.
        gravitational_parameter: of the central body, m³/s²; the Earth's unless given.

    Raises:
        InputError: an element is not a finite number or not possible, or the orbit goes through its central body.
    """

    semi_major_axis: float
    eccentricity: float
    inclination: float
    raan: float = 0.0
    argument_of_periapsis: float = 0.0
    true_anomaly: float = 0.0
    gravitational_parameter: float = EARTH_MU

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _finite(field.name, getattr(self, field.name)))
        failure = _check_set().failure(np.array(self.elements))
        if failure is not None:
            raise InputError(failure)
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"orbit.{name}: found {value:g} {unit}, expected {low:g} to {high:g} {unit}")
        periapsis = self.semi_major_axis * (1 - self.eccentricity)
        if abs(self.gravitational_parameter / EARTH_MU - 1) < 0.01 and periapsis < EARTH_RADIUS:
            raise InputError(
                f"orbit.semi_major_axis: found {self.semi_major_axis:g} m, which puts the periapsis "
                f"{periapsis:g} m from the Earth's centre, expected metres and an orbit above the surface"
            )
        if self.periapsis_rate > MAX_RATE:
            raise InputError(
                f"orbit.semi_major_axis: found {self.semi_major_axis:g} m, where the target passes the periapsis at "
                f"{self.periapsis_rate:g} rad/s, expected at most {MAX_RATE:g} rad/s, as outside any body"
            )

    @property
    def elements(self) -> tuple[float, ...]:
        """The seven elements in the order of the fields, which is that of `keplerian.Elements`."""
        return astuple(self)

    @property
    def period(self) -> float:
        """Orbital period, s."""
        return 2 * pi * sqrt(self.semi_major_axis**3 / self.gravitational_parameter)

    @property
    def mean_motion(self) -> float:
        """Mean angular rate, rad/s."""
        return 2 * pi / self.period

    @property
    def periapsis_rate(self) -> float:
        """Rate of the true anomaly at periapsis, where it is largest, rad/s."""
        e = self.eccentricity
        return self.mean_motion * sqrt((1 + e) / (1 - e) ** 3)


def orbit_parameters(orbit: Orbit) -> dict[str, float]:
    """The unit's orbit parameters (m, rad, m³/s²) by name, in the order of the table of variables."""
    return dict(zip(PARAMETERS, orbit.elements, strict=True))


def _finite(name: str, value: object) -> float:
    """A number as a float.

    Raises:
        InputError: it is not a number, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise InputError(f"orbit.{name}: found {value!r}, expected a number")
    try:
        number = float(value)
    except OverflowError:  # an integer of more than 308 digits
        number = inf
    if not isfinite(number):
        raise InputError(f"orbit.{name}: found {number}, expected a finite number")
    return number


@cache
def _check_set() -> CheckSet:
    column, elements = Elements.symbols()
    return CheckSet.over(column, orbit_checks(elements))
