"""The target's orbit: Keplerian elements in SI units, as estimators and dynamics use it."""

from dataclasses import dataclass, fields, replace
from functools import cache
from math import inf, isfinite, pi, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baryscope.models.checks import CheckSet, orbit_checks
from baryscope.models.errors import InputError
from baryscope.models.keplerian import ELEMENT_COUNT, PARAMETERS, Elements

EARTH_MU = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, WGS 84
EARTH_J2 = 1.08262668e-3  # EGM 96 and 2008
EARTH_ROTATION_RATE = 7.2921159e-5  # rad/s
RANGES = {
    "semi_major_axis": (1.0, 1e15, "m"),
    "gravitational_parameter": (1e-9, 1e30, "m³/s²"),
    "inclination": (-1e6, 1e6, "rad"),
    "raan": (-1e6, 1e6, "rad"),
    "argument_of_periapsis": (-1e6, 1e6, "rad"),
    "true_anomaly": (-1e6, 1e6, "rad"),
    "j2": (-0.5, 0.5, "(no unit)"),
    "equatorial_radius": (1e-3, 1e12, "m"),
}  # wider than the solar system; an angle of 1e6 rad still has ten digits
NUMBERS = ELEMENT_COUNT + 2  # fields of an orbit that are numbers, the first ones
LEAST_ACCURATE = 0.1  # of the semi-major axis, which is no longer an error of the first order
MOST_J2 = 1.1  # of the Earth's, in an orbit around it; less may be part of it
IN_KILOMETRES = EARTH_MU / 1e9  # km³/s²: as a number of m³/s² that of no body whose orbits are known
MAX_RATE = 0.01  # rad/s at periapsis: a higher rate needs a central body over fifty times as dense as rock


class Ephemeris(Protocol):
    """Where the target is."""

    def states(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Position and velocity (n, 6) from the central body's centre in I, m and m/s, at times (n,) in s.

        Raises:
            InputError: a time that it does not cover.
        """
        ...


@dataclass(frozen=True)
class Orbit:
    """Keplerian elements at time 0, inertial axes, angles in rad; with `j2`, those of the ellipse that osculates then.

    Attributes:
        semi_major_axis: m, above 0.
        eccentricity: from 0 to below 1.
        inclination: rad.
        raan: right ascension of the ascending node, rad.
        argument_of_periapsis: rad.
        true_anomaly: at time 0, rad, any number of turns.
        gravitational_parameter: of the central body, m³/s²; the Earth's unless given.
        j2: second zonal coefficient of the central body, whose pole is the z axis of I; None: a point mass.
        equatorial_radius: to which `j2` refers, m; given with it or not at all.
        epoch: UTC of time 0 as a text in ISO 8601; None: unknown.
        accuracy: standard deviation of the target's place along its orbit and across it, m; 0: exact, as in a
            simulation; None: unknown.
        ephemeris: where the target is at any time, if that is known better than from the elements; these then
            osculate at time 0.

    Raises:
        InputError: a value is not a finite number or not possible, the orbit goes through its central body, or `j2`
            stands without `equatorial_radius` or the other way round.
    """

    semi_major_axis: float
    eccentricity: float
    inclination: float
    raan: float = 0.0
    argument_of_periapsis: float = 0.0
    true_anomaly: float = 0.0
    gravitational_parameter: float = EARTH_MU
    j2: float | None = None
    equatorial_radius: float | None = None
    epoch: str | None = None
    accuracy: float | None = None
    ephemeris: Ephemeris | None = None

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)[:NUMBERS]):
            value = getattr(self, name)
            if name not in ("j2", "equatorial_radius") or value is not None:
                object.__setattr__(self, name, _finite(name, value))
        failure = _check_set().failure(np.array(self.elements))
        if failure is not None:
            raise InputError(failure)
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise InputError(f"orbit.{name}: found {value:g} {unit}, expected {low:g} to {high:g} {unit}")
        if abs(self.gravitational_parameter / IN_KILOMETRES - 1) < 0.002:
            raise InputError(
                f"orbit.gravitational_parameter: found {self.gravitational_parameter:g} m³/s², the Earth's in km³/s²?, "
                f"expected m³/s², as the Earth's {EARTH_MU:g}"
            )
        periapsis = self.semi_major_axis * (1 - self.eccentricity)
        if self.is_the_earths and periapsis < EARTH_RADIUS:
            raise InputError(
                f"orbit.semi_major_axis: found {self.semi_major_axis:g} m, which puts the periapsis "
                f"{periapsis:g} m from the Earth's centre, expected metres and an orbit above the surface"
            )
        if self.periapsis_rate > MAX_RATE:
            raise InputError(
                f"orbit.semi_major_axis: found {self.semi_major_axis:g} m, where the target passes the periapsis at "
                f"{self.periapsis_rate:g} rad/s, expected at most {MAX_RATE:g} rad/s, as outside any body"
            )
        self._check_oblateness(periapsis)
        self._check_accuracy()

    def _check_oblateness(self, periapsis: float) -> None:
        """J2 needs its radius and the other way round; a radius in km would make it vanish in silence.

        Raises:
            InputError: one is missing, or they cannot be those of the Earth in an orbit around it.
        """
        given, missing = ("j2", "equatorial_radius") if self.j2 is not None else ("equatorial_radius", "j2")
        if getattr(self, given) is not None and getattr(self, missing) is None:
            raise InputError(f"orbit.{missing}: missing, expected a value beside {given}")
        radius = self.equatorial_radius
        if radius is not None and self.is_the_earths and abs(radius / EARTH_RADIUS - 1) > 0.01:
            raise InputError(
                f"orbit.equatorial_radius: found {radius:g} m, expected the Earth's, {EARTH_RADIUS:g} m, to 1 %"
            )
        if self.j2 is not None and self.is_the_earths and not 0 <= self.j2 <= MOST_J2 * EARTH_J2:
            raise InputError(f"orbit.j2: found {self.j2:g}, expected the Earth's, {EARTH_J2:g}, or 0 for a point mass")
        if radius is not None and radius > periapsis:
            raise InputError(
                f"orbit.equatorial_radius: found {radius:g} m, expected at most the distance of the periapsis, "
                f"{periapsis:g} m"
            )

    def _check_accuracy(self) -> None:
        """An accuracy is a length that is small against the orbit.

        Raises:
            InputError: it is not.
        """
        if self.accuracy is None:
            return
        value, greatest = _finite("accuracy", self.accuracy), LEAST_ACCURATE * self.semi_major_axis
        if not 0 <= value <= greatest:
            raise InputError(
                f"orbit.accuracy: found {value:g} m, expected 0 to {greatest:g} m, a tenth of semi_major_axis"
            )
        object.__setattr__(self, "accuracy", value)

    def with_earths_j2(self) -> "Orbit | None":
        """The same orbit with the Earth's J2, about the z axis; None if its forces are known, or not the Earth's."""
        if self.j2 is not None or self.ephemeris is not None or not self.is_the_earths:
            return None
        return replace(self, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)

    def of_simulation(self) -> "Orbit":
        """The same orbit, which tells that it is exact, and j2 = 0 where it tells none: there are no forces besides."""
        exact = replace(self, accuracy=0.0)
        return exact if self.with_earths_j2() is None else replace(exact, j2=0.0, equatorial_radius=EARTH_RADIUS)

    @property
    def elements(self) -> tuple[float, ...]:
        """The seven elements in the order of the fields, which is that of `keplerian.Elements`."""
        return tuple(getattr(self, field.name) for field in fields(self)[:ELEMENT_COUNT])

    @property
    def is_the_earths(self) -> bool:
        """Whether the central body is the Earth."""
        return abs(self.gravitational_parameter / EARTH_MU - 1) < 0.01

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
