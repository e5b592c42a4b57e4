"""The tables of a scenario file, except the orbit, with the checks of single fields."""

from collections import Counter
from math import hypot, inf, sqrt
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from baryscope.models.scenario.schema import (
    FileModel,
    PositionVector,
    RateVector,
    Seconds,
    Unit,
    Vector,
    VelocityVector,
)

NORMAL_LENGTH = 1e-9  # below which a vector has no direction
MAX_FEATURES = 1000  # of a unit: each has outputs of its own
LEAST_MOMENT = 1e-9  # kg m², of a gram of some millimetres
LEAST_RANGE = 1e-3  # m
LEAST_NOISE = 1e-12  # m

Moment = Annotated[float, Field(ge=-1e15, le=1e15)]
Row = tuple[Moment, Moment, Moment]


class Target(FileModel):
    """[target]: the inertia of the body, and its attitude and angular rate at time 0."""

    inertia: Annotated[tuple[Row, Row, Row], Unit("kg m²")]
    attitude: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    angular_rate_deg: Annotated[RateVector, Unit("deg/s")]
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
        small = next((i for i in range(3) if 0 < J[i, i] < LEAST_MOMENT), None)
        if small is not None:
            raise ValueError(
                f"found {J[small, small]:g} in row {small + 1}, column {small + 1}, "
                f"expected a moment of inertia of at least {LEAST_MOMENT:g} kg m²"
            )
        return rows


class FeaturePoint(FileModel):
    """One feature: a point on the body's surface and the outward normal, in body axes with the origin at the CoM."""

    label: str = Field(min_length=1)
    position: PositionVector
    normal: Vector

    @field_validator("normal")
    @classmethod
    def _unit_length(cls, normal: Vector) -> Vector:
        length = sqrt(sum(c * c for c in normal))
        if length < NORMAL_LENGTH:
            raise ValueError(f"found {list(normal)}, expected a vector of any length above {NORMAL_LENGTH:g}")
        x, y, z = (c / length for c in normal)
        return (x, y, z)


class Features(FileModel):
    """[features]: points that can be tracked on the target."""

    points: tuple[FeaturePoint, ...] = Field(min_length=3, max_length=MAX_FEATURES)

    @field_validator("points")
    @classmethod
    def _distinct_labels(cls, points: tuple[FeaturePoint, ...]) -> tuple[FeaturePoint, ...]:
        label, times = Counter(point.label for point in points).most_common(1)[0]
        if times > 1:
            raise ValueError(f"label {label!r} occurs {times} times, expected once")
        return points

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels, in the order of the unit's features."""
        return tuple(point.label for point in self.points)


class Chaser(FileModel):
    """[chaser]: position and velocity of the observer at time 0, and its constant acceleration, in LVLH.

    `acceleration_noise` is the density of a white acceleration that thrusters add: by so
    much the velocity's variance grows every second, on each axis. A flight holds it over each sample interval.
    """

    position: PositionVector
    velocity: VelocityVector = (0.0, 0.0, 0.0)
    acceleration: Annotated[RateVector, Unit("m/s²")] = (0.0, 0.0, 0.0)
    acceleration_noise: Annotated[float, Unit("m²/s³"), Field(ge=0, le=1)] = 0.0

    @field_validator("position")
    @classmethod
    def _away(cls, position: Vector) -> Vector:
        distance = hypot(*position)
        if 0 < distance < LEAST_RANGE:
            raise ValueError(
                f"found a range of {distance:g} m, "
                f"expected a chaser at least {LEAST_RANGE:g} m away from the target's centre of mass"
            )
        return position


class Interval(FileModel):
    """An interval of time in which one cluster of features is tracked."""

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
    """[tracking]: the features tracked in each interval; without intervals, all features at all times.

    Times outside every interval are blackouts. With `visibility = "facing"` a feature is seen only while the
    angle between its normal and the direction to the chaser is at most `max_incidence_deg`.
    """

    intervals: tuple[Interval, ...] = ()
    visibility: Literal["all", "facing"] = "all"
    max_incidence_deg: Annotated[float, Unit("deg"), Field(gt=0, le=90)] = 75.0


Pixels = Annotated[int, Field(ge=1, le=1_000_000)]


class StereoRig(FileModel):
    """[sensor.stereo]: a rectified pair of cameras at the chaser that points at the target's CoM.

    `pixel_noise` is the standard deviation of each pixel coordinate. The baseline is normal to the boresight; its
    direction is that of `baryscope.models.sensor.directions.axes_along`. `resolution` is the images' size, with the
    principal point in the middle; without it they have no edges.
    """

    focal_length: Annotated[float, Unit("px"), Field(ge=1, le=1e9)]
    baseline: Annotated[float, Unit("m"), Field(ge=1e-6, le=1e6)]
    pixel_noise: Annotated[float, Unit("px"), Field(ge=1e-9, le=1e6)]
    resolution: Annotated[tuple[Pixels, Pixels] | None, Unit("px")] = None


class Outliers(FileModel):
    """[sensor.outliers]: gross errors; none by default.

    A `share` of all observations has an additional random error of rms length `size`. Another share, `swapped`, has the
    label of another visible feature: two features swap labels for a `stretch` of time. `sliding` features start to move
    along the surface at a random time, at `sliding_speed`.
    """

    share: float = Field(default=0.0, ge=0, lt=1)
    size: Annotated[float, Unit("m"), Field(gt=0, le=1e9)] = 2.0
    swapped: float = Field(default=0.0, ge=0, lt=1)
    stretch: Annotated[float, Unit("s"), Field(ge=1e-9, le=1e10)] = 10.0
    sliding: int = Field(default=0, ge=0)
    sliding_speed: Annotated[float, Unit("m/s"), Field(gt=0, le=1e6)] = 0.005


class Sensor(FileModel):
    """[sensor]: measurement noise, share of lost observations (`dropout`), and gross errors.

    The noise is isotropic and Gaussian (`noise`: standard deviation per axis), or that of a stereo rig.
    """

    noise: Annotated[float, Unit("m"), Field(ge=0, le=1e9)] = 0.02
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
        if 0 < self.noise < LEAST_NOISE:
            raise ValueError(
                f"sensor.noise: found {self.noise:g} m, expected 0 or a value of at least {LEAST_NOISE:g} in m"
            )
        return self


class Run(FileModel):
    """[run]: duration, sample time, seed of all random numbers, and the integrator's relative tolerance."""

    duration: Annotated[float | None, Unit("s"), Field(ge=1e-6, le=1e10)] = None  # None: one period
    sample_time: Annotated[float, Unit("s"), Field(gt=0, le=1e10)] = 1.0
    seed: int = Field(default=1, ge=0, lt=2**64)
    tolerance: float = 1e-13  # keeps the attitude to 1e-9 rad over an orbit in steps of any length
