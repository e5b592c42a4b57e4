"""Scenarios: what is flown, as TOML files checked by pydantic, and the presets that come along.

The physics of a scenario (inertia, orbit, features, range) is checked by the same expressions as in the unit,
see `baryscope.models.checks`.
"""

from functools import cache
from importlib.resources import files
from math import inf, pi, sqrt
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator, model_validator

from baryscope.models.checks import CheckSet, orbit_checks
from baryscope.models.errors import InputError
from baryscope.models.schema import (
    Degrees,
    FileModel,
    Metres,
    PositionVector,
    Seconds,
    Unit,
    Vector,
    VelocityVector,
    read_toml,
)
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind, variable_table

EARTH_MU = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, WGS 84
NORMAL_LENGTH = 1e-9
MIN_SAMPLES = 3
MAX_SAMPLES = 10_000_000  # a slip of units in sample_time shall not fill the memory

Row = tuple[float, float, float]


class Target(FileModel):
    """[target]: the body and how it turns at time 0."""

    inertia: Annotated[tuple[Row, Row, Row], Unit("kg m²")]
    attitude: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    angular_rate_deg: Annotated[Vector, Unit("deg/s")]
    gravity_gradient: bool = False

    @field_validator("inertia")
    @classmethod
    def _symmetric(cls, rows: tuple[Row, Row, Row]) -> tuple[Row, Row, Row]:
        J = np.array(rows)
        if not np.allclose(J, J.T, rtol=1e-12, atol=0):
            i, j = next((i, j) for i, j in ((0, 1), (0, 2), (1, 2)) if not np.isclose(J[i, j], J[j, i], 1e-12, 0))
            raise ValueError(
                f"found {J[i, j]:g} in row {i + 1}, column {j + 1} but {J[j, i]:g} in row {j + 1}, column {i + 1}, "
                "expected a symmetric tensor in kg m²"
            )
        return rows


class FeaturePoint(FileModel):
    """One feature: a point on the body's surface and the outward normal there, body axes, origin at the CoM."""

    label: str = Field(min_length=1)
    position: PositionVector
    normal: Vector

    @field_validator("normal")
    @classmethod
    def _unit_length(cls, normal: Vector) -> Vector:
        length = sqrt(sum(c * c for c in normal))
        if length < NORMAL_LENGTH:
            raise ValueError(f"found {list(normal)}, expected a direction (any length above zero)")
        x, y, z = (c / length for c in normal)
        return (x, y, z)


class Features(FileModel):
    """[features]: what can be tracked on the target."""

    points: tuple[FeaturePoint, ...] = Field(min_length=3)

    @field_validator("points")
    @classmethod
    def _distinct_labels(cls, points: tuple[FeaturePoint, ...]) -> tuple[FeaturePoint, ...]:
        labels = [point.label for point in points]
        repeated = next((label for label in labels if labels.count(label) > 1), None)
        if repeated is not None:
            raise ValueError(f"label {repeated!r} stands {labels.count(repeated)} times, expected once")
        return points

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels, in the order of the unit's features."""
        return tuple(point.label for point in self.points)


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


class Chaser(FileModel):
    """[chaser]: where the observer is at time 0, in LVLH, and the acceleration it holds."""

    position: PositionVector
    velocity: VelocityVector = (0.0, 0.0, 0.0)
    acceleration: Annotated[Vector, Unit("m/s²")] = (0.0, 0.0, 0.0)


class Interval(FileModel):
    """A stretch of time in which one cluster of features is tracked."""

    start: Seconds
    end: Seconds
    features: tuple[str, ...] = Field(min_length=1)

    @field_validator("end")
    @classmethod
    def _forward(cls, end: float, info: ValidationInfo) -> float:
        start = info.data.get("start", -inf)
        if end <= start:
            raise ValueError(f"found {end:g} s, expected a time after start, {start:g} s")
        return end


class Tracking(FileModel):
    """[tracking]: which features are followed when; no intervals means all of them, always.

    Times outside every interval are blackouts. With `visibility = "facing"` a feature is seen only while the
    angle between its normal and the direction to the chaser is at most `max_incidence_deg`.
    """

    intervals: tuple[Interval, ...] = ()
    visibility: Literal["all", "facing"] = "all"
    max_incidence_deg: Degrees = Field(default=75.0, gt=0, le=90)


class StereoRig(FileModel):
    """[sensor.stereo]: a rectified pair of cameras at the chaser, which looks at the target's CoM.

    The noise is one standard deviation of each pixel coordinate. The baseline is normal to the boresight, turned about
    it as `baryscope.models.directions.axes_along` says.
    """

    focal_length: Annotated[float, Unit("px"), Field(gt=0)]
    baseline: Annotated[Metres, Field(gt=0)]
    pixel_noise: Annotated[float, Unit("px"), Field(gt=0)]


class Outliers(FileModel):
    """[sensor.outliers]: sightings that are wrong, not only noisy; none unless asked for.

    A `share` of all sightings is off by a random vector of rms length `size`, each by its own. Another share,
    `swapped`, stands under the label of another feature that is seen: pairs change places for a `stretch` of time. And
    some features, `sliding` of them, leave their places at a random time and go along the surface at `sliding_speed`.
    """

    share: float = Field(default=0.0, ge=0, lt=1)
    size: Annotated[Metres, Field(gt=0)] = 2.0
    swapped: float = Field(default=0.0, ge=0, lt=1)
    stretch: Annotated[Seconds, Field(gt=0)] = 10.0
    sliding: int = Field(default=0, ge=0)
    sliding_speed: Annotated[float, Unit("m/s"), Field(gt=0)] = 0.005


class Sensor(FileModel):
    """[sensor]: noise of the positions, the share of sightings that are lost, and those that are wrong.

    The noise is isotropic and Gaussian (one standard deviation per axis), or that of a stereo rig.
    """

    noise: Annotated[Metres, Field(ge=0)] = 0.02
    stereo: StereoRig | None = None
    dropout: float = Field(default=0.0, ge=0, lt=1)
    outliers: Outliers = Outliers()

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        if self.stereo is not None and "noise" in self.model_fields_set:
            raise ValueError(
                f"sensor.noise: found {self.noise:g} m beside sensor.stereo, expected one of them "
                "(a rig has its pixel_noise)"
            )
        return self


class Run(FileModel):
    """[run]: how long, how often, and the seed of everything random."""

    duration: Annotated[float | None, Unit("s"), Field(gt=0)] = None  # None: one orbit
    sample_time: Annotated[Seconds, Field(gt=0)] = 1.0
    seed: int = Field(default=1, ge=0)
    tolerance: float = 1e-13  # keeps the attitude to 1e-9 rad over an orbit in steps of any length


class Scenario(FileModel):
    """A whole scenario.

    Attributes:
        name: its preset name, or the stem of its file.
        description: one line for lists.
    """

    name: str = "scenario"
    description: str = ""
    target: Target
    features: Features
    orbit: Orbit
    chaser: Chaser
    tracking: Tracking = Tracking()
    sensor: Sensor = Sensor()
    run: Run = Run()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        known = self.features.labels
        for index, interval in enumerate(self.tracking.intervals):
            for label in interval.features:
                if label not in known:
                    raise ValueError(
                        f"tracking.intervals[{index}].features: found {label!r}, "
                        f"expected labels of features.points ({', '.join(known)})"
                    )
        sliding = self.sensor.outliers.sliding
        if sliding > len(known):
            raise ValueError(f"sensor.outliers.sliding: found {sliding}, expected at most the {len(known)} features")
        if not MIN_SAMPLES <= self.duration / self.run.sample_time + 1 < MAX_SAMPLES:
            raise ValueError(
                f"run.sample_time: found {self.run.sample_time:g} s, "
                f"expected {MIN_SAMPLES} to {MAX_SAMPLES} samples in the run's {self.duration:g} s"
            )
        failure = tumbling_target(len(self.features.points)).checks.failure(self.flat_parameters())
        if failure is not None:
            raise ValueError(failure)
        return self

    @property
    def duration(self) -> float:
        """Length of the run, s."""
        return self.orbit.period if self.run.duration is None else self.run.duration

    @property
    def sample_times(self) -> NDArray[np.float64]:
        """Times of the samples, s, from 0 to the last one within the duration."""
        count = int(self.duration / self.run.sample_time * (1 + 1e-12)) + 1
        return np.arange(count, dtype=np.float64) * self.run.sample_time

    def parameters(self) -> dict[str, NDArray[np.float64]]:
        """The unit's parameters by name, arrays in the shapes of the table of variables."""
        J = np.array(self.target.inertia)
        axes = {"x": 0, "y": 1, "z": 2}
        values: dict[str, Any] = {
            f"target.inertia.{i}{j}": J[axes[i], axes[j]] for i, j in ("xx", "yy", "zz", "xy", "xz", "yz")
        }
        values |= {
            "target.features": [point.position for point in self.features.points],
            "target.normals": [point.normal for point in self.features.points],
            "target.attitude0": self.target.attitude,
            "target.angularRate0": np.deg2rad(self.target.angular_rate_deg),
            **orbit_parameters(self.orbit),
            "chaser.position0": self.chaser.position,
            "chaser.velocity0": self.chaser.velocity,
            "gravityGradient": float(self.target.gravity_gradient),
            "solver.tolerance": self.run.tolerance,
        }
        return {name: np.asarray(value, dtype=float) for name, value in values.items()}

    def flat_parameters(self) -> NDArray[np.float64]:
        """The unit's parameter vector p, in the order of the table of variables."""
        values = self.parameters()
        table = tumbling_target(len(self.features.points)).of_kind(Kind.PARAMETER)
        return np.concatenate([values[variable.name].ravel() for variable in table])


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


def preset_names() -> list[str]:
    """Names of the presets, sorted."""
    folder = files("baryscope.models") / "presets"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load_scenario(name_or_path: str) -> Scenario:
    """A preset by name, or a scenario file by its path (anything with a folder or the ending .toml).

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml" and len(path.parts) <= 1:
        names = preset_names()
        if name_or_path not in names:
            raise InputError(
                f"scenario {name_or_path!r}: not a preset, expected one of {', '.join(names)} or a FILE.toml"
            )
        path = Path(str(files("baryscope.models") / "presets" / f"{name_or_path}.toml"))
    data = read_toml(path, "a scenario in TOML")
    return Scenario.parse({"name": path.stem} | data, str(path))
