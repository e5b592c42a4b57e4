"""The lenses of a stereo pair as a rig file gives them, as OpenCV's calibration knows them."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, field_validator

from baryscope.models.checks import UNIT_TOLERANCE
from baryscope.models.scenario.schema import FileModel, Unit

FloatArray = NDArray[np.float64]

NOT_TURNED = (1.0, 0.0, 0.0, 0.0)
DISTORTIONS = (0, 4, 5, 8, 12, 14)  # numbers of coefficients that OpenCV knows

Focal = Annotated[float, Field(ge=1, le=1e6)]
Place = Annotated[float, Field(ge=-1e6, le=1e6)]
Coefficient = Annotated[float, Field(ge=-1e3, le=1e3)]
Size = Annotated[int, Field(ge=32, le=32766)]  # OpenCV's maps have no room for more
Offset = Annotated[float, Field(ge=-1e3, le=1e3)]


def _of_unit_length(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = float(np.linalg.norm(value))
    if abs(length - 1) > UNIT_TOLERANCE:
        raise ValueError(f"found a quaternion (w, x, y, z) of length {length:.6g}, expected 1")
    w, x, y, z = (number / length for number in value)
    return (w, x, y, z)


UnitQuaternion = Annotated[tuple[float, float, float, float], AfterValidator(_of_unit_length)]


class Lens(FileModel):
    """[rig.left]: a pinhole and its distortion.

    focal_length: px, of u and v; one number stands for both. principal_point: px; (0, 0) is the centre of the image's
    first pixel. distortion: OpenCV's k1, k2, p1, p2, k3 and so on. resolution: width and height, px.
    """

    focal_length: Annotated[tuple[Focal, Focal], Unit("px")]
    principal_point: Annotated[tuple[Place, Place], Unit("px")]
    resolution: Annotated[tuple[Size, Size], Unit("px")]
    distortion: tuple[Coefficient, ...] = ()

    @field_validator("focal_length", mode="before")
    @classmethod
    def _of_both(cls, value: object) -> object:
        """One number as that of both."""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return (float(value),) * 2 if number else value  # type: ignore[arg-type]

    @field_validator("distortion")
    @classmethod
    def _known(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if len(value) not in DISTORTIONS:
            wanted = ", ".join(map(str, DISTORTIONS[1:-1]))
            raise ValueError(f"found {len(value)} coefficients, expected {wanted} or {DISTORTIONS[-1]}, or none")
        return value

    @property
    def matrix(self) -> FloatArray:
        """The camera matrix K (3, 3)."""
        (f_u, f_v), (c_u, c_v) = self.focal_length, self.principal_point
        return np.array([[f_u, 0.0, c_u], [0.0, f_v, c_v], [0.0, 0.0, 1.0]])


class RightLens(Lens):
    """[rig.right]: a lens, and where it is on the left camera.

    position: m, of the right camera in the left one's axes; mounting: the quaternion (w, x, y, z) that turns the right
    camera's axes into the left one's.
    """

    position: Annotated[tuple[Offset, Offset, Offset], Unit("m")]
    mounting: UnitQuaternion = NOT_TURNED
