"""The table of an orbit, in scenario files and in files of its own."""

from functools import cache
from math import pi, sqrt
from pathlib import Path
from typing import Annotated, Self

import casadi as ca
import numpy as np
from pydantic import model_validator

from baryscope.models.checks import CheckSet, orbit_checks
from baryscope.models.scenario.schema import Degrees, FileModel, Metres, Unit, read_toml
from baryscope.models.variables import Kind, variable_table

EARTH_MU = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, WGS 84


class Orbit(FileModel):
    """[orbit]: the target's Keplerian elements at time 0."""

    semi_major_axis: Metres
    eccentricity: float
    inclination_deg: Degrees
    raan_deg: Degrees = 0.0
    argument_of_periapsis_deg: Degrees = 0.0
    true_anomaly_deg: Degrees = 0.0
    gravitational_parameter: Annotated[float, Unit("m³/s²")] = EARTH_MU

    @model_validator(mode="after")
    def _possible(self) -> Self:
        failure = _orbit_check_set().failure(np.array(list(orbit_parameters(self).values())))
        if failure is not None:
            raise ValueError(failure)
        periapsis = self.semi_major_axis * (1 - self.eccentricity)
        if abs(self.gravitational_parameter / EARTH_MU - 1) < 0.01 and periapsis < EARTH_RADIUS:
            raise ValueError(
                f"orbit.semi_major_axis: found {self.semi_major_axis:g} m, which puts the periapsis "
                f"{periapsis:g} m from the Earth's centre, expected metres and an orbit above the surface"
            )
        return self

    @property
    def period(self) -> float:
        """Time of one revolution, s."""
        return 2 * pi * sqrt(self.semi_major_axis**3 / self.gravitational_parameter)

    @property
    def highest_rate(self) -> float:
        """How fast the true anomaly goes at periapsis, rad/s."""
        e = self.eccentricity
        return 2 * pi / self.period * sqrt((1 + e) / (1 - e) ** 3)

    @classmethod
    def load(cls, path: Path) -> "Orbit":
        """Read an orbit TOML file: one table, [orbit].

        Raises:
            InputError: one line that says where, what was found, what was expected.
        """
        data = read_toml(path, "an orbit in TOML")
        return OrbitFile.parse(data, str(path)).orbit


class OrbitFile(FileModel):
    """A file that holds nothing but an orbit."""

    orbit: Orbit


def orbit_parameters(orbit: Orbit) -> dict[str, float]:
    """The unit's orbit parameters (m, rad, m³/s²) by name, in the order of the table of variables."""
    return {
        "orbit.semiMajorAxis": orbit.semi_major_axis,
        "orbit.eccentricity": orbit.eccentricity,
        "orbit.inclination": float(np.deg2rad(orbit.inclination_deg)),
        "orbit.raan": float(np.deg2rad(orbit.raan_deg)),
        "orbit.argumentOfPeriapsis": float(np.deg2rad(orbit.argument_of_periapsis_deg)),
        "orbit.trueAnomaly0": float(np.deg2rad(orbit.true_anomaly_deg)),
        "orbit.gravitationalParameter": orbit.gravitational_parameter,
    }


@cache
def _orbit_check_set() -> CheckSet:
    names = [v.name for v in variable_table(3) if v.kind == Kind.PARAMETER and v.name.startswith("orbit.")]
    elements = ca.SX.sym("elements", len(names))
    return CheckSet.over(elements, orbit_checks(dict(zip(names, ca.vertsplit(elements), strict=True))))
