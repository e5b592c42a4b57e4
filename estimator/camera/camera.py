"""A camera on the chaser, and tracks that are turned from its axes into C."""

from dataclasses import Field, dataclass, field, replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.rig import Rig, load_rig
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.models.arguments import instance_of
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath

FloatArray = NDArray[np.float64]


class _Tracks(Protocol):
    """What `FeatureTracks` has."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def time(self) -> FloatArray: ...
    @property
    def position(self) -> FloatArray: ...
    @property
    def covariance(self) -> FloatArray | None: ...
    @property
    def epoch(self) -> str | None: ...
    @property
    def camera(self) -> "Camera | None": ...


T = TypeVar("T", bound=_Tracks)


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera on the chaser: its attitude over time, and its rig.

    Raises:
        InputError: one of them is something else.
    """

    attitude: AttitudeSeries
    rig: Rig = field(default_factory=Rig)

    def __post_init__(self) -> None:
        instance_of(
            "camera's attitude", self.attitude, AttitudeSeries, "as of AttitudeSeries.read_csv; Camera.load reads files"
        )
        instance_of("camera's rig", self.rig, Rig, "as of load_rig; Camera.load reads files")

    @classmethod
    def load(cls, attitude: AttitudeSeries | AnyPath, rig: AnyPath | None = None) -> "Camera":
        """The camera of an attitude file, `AttitudeSeries.read_csv`, and a rig file, `load_rig`.

        Raises:
            InputError: one line that says where, what was found, what was expected.
        """
        series = attitude if isinstance(attitude, AttitudeSeries) else AttitudeSeries.read_csv(attitude)
        return cls(series, Rig() if rig is None else load_rig(rig))

    def errors(self, time: FloatArray, epoch: str | None = None) -> SharedErrors:
        """Attitude, place and errors at times (n,) in s from an epoch, UTC in ISO 8601 or None.

        Raises:
            InputError: the camera's attitude at one of the times is not known.
        """
        return SharedErrors.of(self.attitude.at(time, epoch), self.rig, self.attitude.sharing(time, epoch))

    def inertial(self, tracks: T) -> T:
        """Tracks of positions and covariances in camera axes as tracks in C, whose `camera` this one is.

        Raises:
            InputError: the camera's attitude at one of their times is not known, or they are in C already.
        """
        if tracks.camera is not None:
            raise InputError("camera: the tracks are turned into inertial axes already, expected tracks in camera axes")
        seen = self.errors(tracks.time, tracks.epoch)
        R = seen.attitude
        position = tracks.position @ np.swapaxes(R, 1, 2) + seen.place[:, None]
        covariance = tracks.covariance
        if covariance is not None:
            covariance = R[:, None] @ covariance @ np.swapaxes(R, 1, 2)[:, None]
        return replace(tracks, position=position, covariance=covariance, camera=self)
