"""Options of the command line for forces on the chaser and the target, and what they make of an estimate's options."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.options import ConstantAxes, Options, PathOptions
from baryscope.estimator.tables.acceleration import read_acceleration
from baryscope.estimator.thrust import AccelerationAxes, KnownAcceleration
from baryscope.models.errors import InputError


@Parameter(name="*")
@dataclass(frozen=True)
class ForceChoices:
    """Accelerations besides gravity.

    Parameters
    ----------
    acceleration
        The chaser's acceleration by its thrusters (pivot, ml, ekf): a CSV file with the columns time,ax,ay,az (s or
        UTC, m/s²), each row held until the next one. Zero before the first row.
    acceleration_axes
        Axes of --acceleration: inertial, those of the tracks; lvlh, of the target on --orbit as it is told, whatever
        its error; or camera, with --camera. Default: inertial.
    acceleration_scale
        Standard deviation of the relative error of the accelerometer's scale, which is then estimated (pivot, ml).
        Default: 0.
    acceleration_firing
        Standard deviation of each coordinate's error in a firing, over the acceleration's magnitude, independent from
        firing to firing (pivot, ml; a zero row ends one). Default: 0.
    acceleration_noise
        Density of the accelerometer's white noise, m²/s³, the least process noise. Default: 0.
    constant_acceleration
        An unknown constant acceleration of the target less the chaser's (pivot, ml), with --orbit: drag, against the
        velocity through air that turns with the Earth; sun, away from the Sun and none in shadow, as of light; lvlh
        or inertial, in any direction in these axes; or none. Default: none.
    """

    acceleration: Path | None = None
    acceleration_axes: AccelerationAxes | None = None
    acceleration_scale: float | None = None
    acceleration_firing: float | None = None
    acceleration_noise: float | None = None
    constant_acceleration: ConstantAxes | None = None

    def chosen(self) -> dict[str, Any]:
        """The options of a method that they concern, by name, None where not given; the acceleration as a file.

        Raises:
            InputError: a property of an acceleration without one.
        """
        if self.acceleration is None:
            for name in ("axes", "scale", "firing", "noise"):
                if getattr(self, f"acceleration_{name}") is not None:
                    raise InputError(f"--acceleration-{name}: needs --acceleration, expected --acceleration A.csv")
        return {"acceleration": self.acceleration, "constant_acceleration": self.constant_acceleration}

    def read_into(self, options: Options, epoch: str | None, camera: Camera | None = None) -> Options:
        """The options with the acceleration from its file; epoch: UTC of time 0, if known; camera: of the tracks.

        Raises:
            InputError: the file or a property is wrong.
        """
        if self.acceleration is None or not isinstance(options, PathOptions):
            return options
        time, value = read_acceleration(self.acceleration, epoch)
        if self.acceleration_axes == "camera" and camera is None:
            raise InputError("--acceleration-axes: found camera, which needs its attitude, expected --camera A.csv")
        known = KnownAcceleration(
            time,
            value,
            self.acceleration_axes or "inertial",
            scale=self.acceleration_scale or 0.0,
            firing=self.acceleration_firing or 0.0,
            noise=self.acceleration_noise or 0.0,
            attitude=None if camera is None else _attitude_of(camera, epoch),
        )
        return replace(options, acceleration=known)


def _attitude_of(camera: Camera, epoch: str | None) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """The rotations (n, 3, 3) from the camera's axes to C at times (n,) in s from the UTC `epoch` of time 0."""
    attitude = camera.attitude
    return partial(attitude.at, epoch=None if attitude.epoch is None else epoch)
