"""Errors that all observations of a frame share: those of the camera's attitude, its scale and its place.

A camera at c with the attitude R (camera axes into C) whose boresight is off by the rotation β, whose scale is off by s
and whose place is off by l sees a point p of C, to first order, at

    p + R β × (p − c) + s (p − c) + R l.

β is about the camera's axes, l in those of the lever arm. The points of a body with its centre of mass at g move by
what g moves, turn about it by R β, and grow by s. A noise ε of the attitude, new in every frame, turns the lever arm,
too, by which c follows from the attitude: it moves p by ε × p.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.geometry.so3 import cross_matrices

FloatArray = NDArray[np.float64]

NAMES = (*(f"boresight {axis}" for axis in "xyz"), "scale", *(f"lever arm {axis}" for axis in "xyz"))
UNITS = ("rad",) * 3 + ("1",) + ("m",) * 3


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """The errors of a rig at n times: attitude (n, 3, 3) of the camera in C, and its place (n, 3) in C, m.

    The k constant errors are those of β (rad), s and l (m) whose standard deviation is not zero, in this order.
    sharing: in how many of the times the attitude's noise is the same, (n,), as between two of its rows.
    """

    attitude: FloatArray
    place: FloatArray
    rig: Rig
    sharing: FloatArray | float = 1.0

    @classmethod
    def of(cls, attitude: FloatArray, rig: Rig, sharing: FloatArray | float = 1.0) -> "SharedErrors":
        """The errors of a rig with the attitude (n, 3, 3), placed by its lever arm from the chaser's centre of mass."""
        return cls(attitude, attitude @ (_lever_axes(rig) @ np.array(rig.lever_arm)), rig, sharing)

    @cached_property
    def deviations(self) -> FloatArray:
        """The standard deviations (k,) of the constant errors."""
        return np.asarray(self._all[self._uncertain])

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the constant errors."""
        return tuple(compress(NAMES, self._uncertain))

    @property
    def units(self) -> tuple[str, ...]:
        """Their units."""
        return tuple(compress(UNITS, self._uncertain))

    @property
    def scale(self) -> int | None:
        """Which of the constant errors is that of the scale, None if none is."""
        return int(self._uncertain[:3].sum()) if self._uncertain[3] else None

    @property
    def noisy(self) -> bool:
        """Whether the attitude has noise."""
        return bool(np.any(self.rig.attitude_noise))

    def shifts(self, origin: FloatArray) -> FloatArray:
        """The derivatives (n, 3, k) of what is seen of points at origin (n, 3) in C, m, by the constant errors."""
        arm = origin - self.place
        by_turn = -cross_matrices(arm) @ self.attitude
        by_place = self.attitude @ _lever_axes(self.rig)
        found = np.concatenate([by_turn, arm[:, :, None], by_place], axis=2)
        return np.asarray(found[:, :, self._uncertain])

    def turns(self) -> FloatArray:
        """The derivatives (n, 3, k) of what is seen of a body's attitude, rotation vectors in C, by them."""
        found = np.zeros((len(self.attitude), 3, 7))
        found[:, :, :3] = self.attitude
        return np.asarray(found[:, :, self._uncertain])

    def turn_covariance(self) -> FloatArray:
        """The covariance (n, 3, 3) of a noise of the attitude that is new in every frame and costs as much as one that
        some frames share: rotation vectors in C, rad²."""
        return np.asarray(np.reshape(self.sharing, (-1, 1, 1)) * self._turn_covariance())

    def _turn_covariance(self) -> FloatArray:
        """The covariance (n, 3, 3) of the attitude's noise in a frame, a rotation vector in C, rad²."""
        variance = np.square(self.rig.attitude_noise)
        return np.asarray((self.attitude * variance) @ np.swapaxes(self.attitude, 1, 2))

    def attitude_covariance(self, of_errors: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) of attitudes, rotation vectors in C, for that (k, k) of the errors, and noise."""
        turns = self.turns()
        return np.asarray(turns @ of_errors @ np.swapaxes(turns, 1, 2) + self._turn_covariance())

    def shift_covariance(self, origin: FloatArray) -> FloatArray:
        """What the attitude's noise makes of points at origin (n, 3) in C: the covariance (n, 3, 3), m²."""
        arms = cross_matrices(origin)
        return np.asarray(arms @ self.turn_covariance() @ np.swapaxes(arms, 1, 2))

    def consider_covariance(self, origin: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) in C, m², that the constant errors give to points at origin (n, 3) in C."""
        columns = self.shifts(origin) * self.deviations
        return np.asarray(columns @ np.swapaxes(columns, 1, 2))

    @cached_property
    def _all(self) -> FloatArray:
        return np.hstack([self.rig.boresight_deviation, self.rig.scale_deviation, self.rig.lever_arm_deviation])

    @cached_property
    def _uncertain(self) -> NDArray[np.bool_]:
        return self._all > 0


def _lever_axes(rig: Rig) -> FloatArray:
    """The rotation (3, 3) from the axes of the lever arm to the camera's."""
    return np.asarray(matrix_from_quaternion(np.array([rig.mounting]))[0].T)
