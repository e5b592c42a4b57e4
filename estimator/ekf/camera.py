"""What a camera with constant errors makes of the motion that `ekf` estimates: consider parameters (Schmidt 1966).

As in `paths.seen_path` they are unknowns of the path, which do not move it, with a prior. They shift and turn the body
in each frame as it is seen, and a wrong scale makes it grow.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.geometry.so3 import exp_rotation
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.seen_path import errors_in
from baryscope.estimator.tracks import FloatArray


@dataclass(frozen=True, eq=False)
class CameraErrors:
    """The constant errors of a camera: at k frames; where they are among a path's unknowns x, own; their values (e,)
    about which all is linearised, in rad, 1 and m.
    """

    errors: SharedErrors
    own: slice
    values: FloatArray

    @classmethod
    def of(cls, errors: SharedErrors | None, path: Path) -> "CameraErrors | None":
        """The errors at zero, None if the path has none among its unknowns."""
        own = errors_in(path)
        return None if errors is None or own.start == own.stop else cls(errors, own, np.zeros(own.stop - own.start))

    def moved(self, x: FloatArray) -> "CameraErrors":
        """The errors after a change of the path's unknowns x (s,)."""
        return replace(self, values=self.values + x[self.own])

    def seen(
        self, attitude: FloatArray, origin: FloatArray, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The attitude (k, 3, 3) and origin (k, 3) in C, m, and the points (m, 3) in B, m, as the camera sees them."""
        scale = self.errors.scale
        turned = exp_rotation(self.errors.turns() @ self.values) @ attitude
        grown = 1.0 if scale is None else 1 + self.values[scale]
        return turned, origin + self.errors.shifts(origin) @ self.values, grown * points

    def movements(self, attitude: FloatArray, origin: FloatArray) -> FloatArray:
        """What each error shifts and turns the body by in B, (k, 6, e): τ in m, then the rotation vector φ.

        attitude (k, 3, 3): as it is seen; origin (k, 3) in C, m: the centre of mass.
        """
        R_B_C = np.swapaxes(attitude, 1, 2)
        return np.concatenate([R_B_C @ self.errors.shifts(origin), R_B_C @ self.errors.turns()], axis=1)

    def growths(self, points: FloatArray) -> FloatArray:
        """What each error moves the points (m, 3) in B by from the centre of mass, (3 m, e), m."""
        found = np.zeros((points.size, len(self.values)))
        if self.errors.scale is not None:
            found[:, self.errors.scale] = points.ravel()
        return found

    def greatest(self, x: FloatArray) -> float:
        """The greatest change of an angle, or of the scale, by a change of the path's unknowns x (s,), rad."""
        change = x[self.own].copy()
        change[[unit == "m" for unit in self.errors.units]] = 0.0
        return float(np.linalg.norm(change))
