"""The rig of a camera: its lever arm, and the standard deviations of what calibration leaves uncertain."""

from dataclasses import dataclass
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from baryscope.estimator.camera.lens import NOT_TURNED, Lens, RightLens, UnitQuaternion
from baryscope.estimator.camera.pair import CameraPair
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario.schema import FileModel, Unit, read_toml

LONGEST_ARM = 100.0  # m: no chaser is larger, and millimetres taken for metres are
WIDEST_ANGLE = 0.2  # rad: to first order, an angle's error is its sine
WIDEST_SCALE = 0.2  # likewise to first order: of a scale and an error of it, the product is left out

Triple = tuple[float, float, float]
Arm = Annotated[float, Field(ge=-LONGEST_ARM, le=LONGEST_ARM)]
Angle = Annotated[float, Field(ge=0, le=WIDEST_ANGLE)]
Length = Annotated[float, Field(ge=0, le=LONGEST_ARM)]


class RigTable(FileModel):
    """[rig]: where the camera is on the chaser, and standard deviations, for which one number means all three axes.

    left and right are the lenses of a stereo pair, which `load_pair` reads: the camera is the left one.
    """

    lever_arm: Annotated[tuple[Arm, Arm, Arm], Unit("m")] = (0.0, 0.0, 0.0)
    lever_arm_axes: Literal["camera", "chaser"] = "camera"
    mounting: UnitQuaternion = NOT_TURNED
    lever_arm_deviation: Annotated[tuple[Length, Length, Length], Unit("m")] = (0.0, 0.0, 0.0)
    boresight_deviation: Annotated[tuple[Angle, Angle, Angle], Unit("rad")] = (0.0, 0.0, 0.0)
    scale_deviation: Annotated[float, Field(ge=0, le=WIDEST_SCALE)] = 0.0
    attitude_noise: Annotated[tuple[Angle, Angle, Angle], Unit("rad")] = (0.0, 0.0, 0.0)
    left: Lens | None = None
    right: RightLens | None = None

    @field_validator("lever_arm_deviation", "boresight_deviation", "attitude_noise", mode="before")
    @classmethod
    def _of_all_axes(cls, value: object) -> object:
        """One number as that of three axes."""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return (float(value),) * 3 if number else value  # type: ignore[arg-type]


class RigFile(FileModel):
    """A rig file: one table, [rig]."""

    rig: RigTable

    @model_validator(mode="after")
    def _mounted(self) -> Self:
        """A mounting if and only if the lever arm is in the chaser's axes."""
        rig = self.rig
        if rig.mounting != NOT_TURNED and rig.lever_arm_axes == "camera":
            raise ValueError('rig.mounting: found beside a lever arm in camera axes, expected axes "chaser"')
        if rig.lever_arm_axes == "chaser" and "mounting" not in rig.model_fields_set:
            raise ValueError('rig.mounting: missing, expected a quaternion beside lever_arm_axes = "chaser"')
        return self


@dataclass(frozen=True)
class Rig:
    """Where a camera is on the chaser, and what is uncertain about it.

    lever_arm: the camera's position from the chaser's centre of mass in m, in axes of the camera, or of the chaser,
    into which the quaternion `mounting` (w, x, y, z) turns those of the camera. Standard deviations of constant errors:
    lever_arm_deviation in m, in the same axes; boresight_deviation in rad, of a rotation about the camera's axes;
    scale_deviation, relative, as that of a stereo rig's baseline. attitude_noise in rad, about the camera's axes,
    independent from row to row of the camera's attitude.

    Raises:
        InputError: a value is not a finite number or not possible.
    """

    lever_arm: Triple = (0.0, 0.0, 0.0)
    lever_arm_axes: Literal["camera", "chaser"] = "camera"
    mounting: tuple[float, float, float, float] = NOT_TURNED
    lever_arm_deviation: float | Triple = 0.0
    boresight_deviation: float | Triple = 0.0
    scale_deviation: float = 0.0
    attitude_noise: float | Triple = 0.0

    def __post_init__(self) -> None:
        table = RigFile.parse({"rig": {name: _plain(value) for name, value in vars(self).items()}}, "rig").rig
        for name in vars(self):
            object.__setattr__(self, name, getattr(table, name))


def load_rig(path: AnyPath) -> Rig:
    """Read a rig file: TOML with one table, [rig], whose fields are those of `Rig`; lenses in it are checked.

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    table = RigFile.parse(read_toml(path, "a camera's rig in TOML"), str(path)).rig
    return Rig(**table.model_dump(exclude={"left", "right"}))


def load_pair(path: AnyPath) -> CameraPair:
    """Read the pair of a rig file, the tables [rig.left] and [rig.right].

    Raises:
        InputError: one line that says where, what was found, what was expected.
    """
    rig = RigFile.parse(read_toml(path, "a camera's rig in TOML"), str(path)).rig
    if rig.left is None or rig.right is None:
        missing = "rig.left" if rig.left is None else "rig.right"
        raise InputError(f"{path}: {missing}: missing, expected a table with focal_length, principal_point, resolution")
    try:
        return CameraPair(rig.left, rig.right)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _plain(value: object) -> object:
    """Numbers of numpy, and in its arrays, as Python's."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return tuple(map(_plain, value))
    return float(value) if isinstance(value, int | float | np.number) and not isinstance(value, bool) else value
