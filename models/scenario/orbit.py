"""Orbit files: the table [orbit] with angles in degrees, converted to `Orbit` in SI units and back."""

import json
from dataclasses import replace
from datetime import UTC, datetime
from math import inf, nextafter
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, field_validator

from baryscope.models.ephemeris import MAX_BYTES, OLDEST, elements_of, orbit_of_message
from baryscope.models.ephemeris.trajectory import target_states
from baryscope.models.ephemeris.utc import DAY, Moment, Utc, seconds_between, utc_of, utc_text
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_text, write_together
from baryscope.models.orbit import EARTH_MU, Orbit
from baryscope.models.scenario.schema import Degrees, FileModel, ReadFrom, Unit, UnitTable, toml_of


class OrbitTable(UnitTable):
    """[orbit]: the target's Keplerian elements at time 0, with angles in degrees; optionally J2 of the central body.

    `epoch` is the UTC of time 0. With `j2` and `equatorial_radius` (both or neither) the elements are those of the
    ellipse that osculates at time 0, and the z axis of I is the body's pole. `accuracy` is the standard deviation of
    the target's place along its orbit and across it.
    """

    semi_major_axis: Annotated[float, Unit("m")]
    eccentricity: float
    inclination_deg: Annotated[float, Unit("deg"), Field(ge=-180, le=180)]
    raan_deg: Degrees = 0.0
    argument_of_periapsis_deg: Degrees = 0.0
    true_anomaly_deg: Degrees = 0.0
    gravitational_parameter: Annotated[float, Unit("m³/s²")] = EARTH_MU
    j2: float | None = None
    equatorial_radius: Annotated[float | None, Unit("m")] = None
    epoch: str | None = None
    accuracy: Annotated[float | None, Unit("m")] = None

    @field_validator("epoch", mode="before")
    @classmethod
    def _as_text(cls, value: Any) -> Any:
        """A time of TOML as text: without an offset it is UTC."""
        if isinstance(value, datetime) and value.tzinfo is not None:
            value = value.astimezone(UTC).replace(tzinfo=None)
        return value.isoformat() if isinstance(value, datetime) else value

    @classmethod
    def of(cls, value: Orbit) -> Self:
        """The table of an orbit. A table that is converted to SI and back keeps its digits."""
        return cls(
            semi_major_axis=value.semi_major_axis,
            eccentricity=value.eccentricity,
            inclination_deg=degrees_of(value.inclination),
            raan_deg=degrees_of(value.raan),
            argument_of_periapsis_deg=degrees_of(value.argument_of_periapsis),
            true_anomaly_deg=degrees_of(value.true_anomaly),
            gravitational_parameter=value.gravitational_parameter,
            j2=value.j2,
            equatorial_radius=value.equatorial_radius,
            epoch=value.epoch,
            accuracy=value.accuracy,
        )

    def to_si(self) -> Orbit:
        """The orbit in m, rad and m³/s².

        Raises:
            InputError: a value is outside its range, or one of `j2` and `equatorial_radius` is missing.
        """
        return Orbit(
            semi_major_axis=self.semi_major_axis,
            eccentricity=self.eccentricity,
            inclination=float(np.deg2rad(self.inclination_deg)),
            raan=float(np.deg2rad(self.raan_deg)),
            argument_of_periapsis=float(np.deg2rad(self.argument_of_periapsis_deg)),
            true_anomaly=float(np.deg2rad(self.true_anomaly_deg)),
            gravitational_parameter=self.gravitational_parameter,
            j2=self.j2,
            equatorial_radius=self.equatorial_radius,
            epoch=None if self.epoch is None else utc_text(utc_of(self.epoch, "orbit.epoch")),
            accuracy=self.accuracy,
        )


OrbitField = Annotated[Orbit, ReadFrom(OrbitTable)]


class OrbitFile(FileModel):
    """An orbit file: one table, [orbit]."""

    orbit: OrbitField


def load_orbit(path: AnyPath, epoch: Utc | None = None) -> Orbit:
    """Read an orbit file: TOML with one table, [orbit], or a TLE, OMM or OEM (`baryscope.models.ephemeris`).

    Args:
        path: the file.
        epoch: UTC of time 0, as text in ISO 8601 or as datetime. A TLE, OMM or OEM needs it; elements in TOML are
            carried from their own epoch to it, and are those of time 0 if they have none.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    expected = "an orbit in TOML, TLE, OMM or OEM"
    moment = None if epoch is None else utc_of(epoch, "epoch")
    text = read_text(path, expected, MAX_BYTES)
    orbit = orbit_of_message(text, str(path), moment)
    if orbit is not None:
        return orbit
    data = toml_of(text, str(path), expected)
    if {"target", "features", "chaser"} & set(data):
        raise InputError(f"{path}: holds a scenario, expected an orbit: its table [orbit], alone in a file")
    orbit = OrbitFile.parse(data, str(path)).orbit
    return orbit if moment is None else _at_epoch(orbit, moment, str(path))


def _at_epoch(orbit: Orbit, moment: Moment, source: str) -> Orbit:
    """The same orbit with time 0 at a moment.

    Raises:
        InputError: its elements are too old.
    """
    if orbit.epoch is None:
        return replace(orbit, epoch=utc_text(moment))
    elapsed = seconds_between(utc_of(orbit.epoch, "orbit.epoch"), moment)
    if elapsed == 0:
        return orbit
    if abs(elapsed) > OLDEST * DAY:
        raise InputError(
            f"{source}: elements of {orbit.epoch}, {abs(elapsed) / DAY:.0f} days from time 0 of the tracks, "
            f"expected elements of within {OLDEST} days"
        )
    state = target_states(orbit, np.array([elapsed]))[0]
    changes: dict[str, Any] = {**elements_of(state, orbit.gravitational_parameter), "epoch": utc_text(moment)}
    return replace(orbit, **changes)


def write_orbit(orbit: Orbit, path: AnyPath) -> None:
    """Write an orbit TOML file, which `load_orbit` reads back to the same orbit.

    Raises:
        InputError: the file cannot be written.
    """
    write_together({Path(path): lambda stream: stream.write(orbit_text(orbit))})


def orbit_text(orbit: Orbit) -> str:
    """The text of an orbit TOML file."""
    rows = [
        f"{name} = {json.dumps(value)}" for name, value in OrbitTable.of(orbit).model_dump(exclude_none=True).items()
    ]
    return "\n".join(["[orbit]", *rows]) + "\n"


def degrees_of(angle: float) -> float:
    """An angle in degrees: the shortest of the numbers that convert to exactly this angle in rad.

    If there is none (the rounding step in degrees can exceed that in rad), the nearest.
    """
    nearest = float(np.rad2deg(angle))
    close = [nearest]
    for direction in (-inf, inf):
        neighbour = nearest
        for _ in range(2):
            neighbour = nextafter(neighbour, direction)
            close.append(neighbour)
    exact = [degrees for degrees in close if np.deg2rad(degrees) == angle]
    return min(exact or [nearest], key=lambda degrees: len(repr(degrees)))
