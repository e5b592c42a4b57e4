"""A stereo pair of cameras, whose left one is the camera of the rig."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.lens import Lens, RightLens
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]

STEEPEST = 0.5  # of the baseline across the left camera's x axis, over that along it


@dataclass(frozen=True)
class CameraPair:
    """Two cameras, x to the right, y down, z ahead; the right one is to the right of the left one.

    Raises:
        InputError: it is not, or the images differ in size.
    """

    left: Lens
    right: RightLens

    def __post_init__(self) -> None:
        x, y, z = self.right.position
        if x <= 0 or np.hypot(y, z) > STEEPEST * x:
            raise InputError(
                f"rig.right.position: found [{x:g}, {y:g}, {z:g}] m, expected a right camera to the right of the left "
                f"one: x above 0, and at most {STEEPEST:g} x across it"
            )
        if self.left.resolution != self.right.resolution:
            found = " and ".join("×".join(map(str, lens.resolution)) for lens in (self.left, self.right))
            raise InputError(f"rig.right.resolution: found images of {found} px, expected two of one size")

    @property
    def R_left_right(self) -> FloatArray:
        """The right camera's axes in the left one's, (3, 3)."""
        return np.asarray(matrix_from_quaternion(np.array([self.right.mounting]))[0])
