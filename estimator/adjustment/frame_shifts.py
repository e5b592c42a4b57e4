"""Shifts of whole frames by noise of a known covariance, as that of a camera's attitude or of a pivot that slips."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.shared import SharedErrors

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FrameShifts:
    """The shifts of n frames: each has one of its own.

    covariance (n, 3, 3) in C, over the variance of an observation of weight 1 in a frame by itself. The errors of the
    features are the same in so many frames, lasting: what all frames tell together has that many times their variance.
    """

    covariance: FloatArray
    lasting: float = 1.0

    @classmethod
    def of(
        cls, errors: SharedErrors | None, origin: FloatArray, slip: float, variance: float, lasting: float
    ) -> "FrameShifts | None":
        """The shifts by noise of the camera's attitude, and by white noise of the position.

        None where there is neither. slip: variance of the latter, m²; origin (n, 3) in C, m: the path;
        variance: of an observation of weight 1 in a frame by itself, in m² or 1.
        """
        noisy = errors is not None and errors.noisy
        if not (noisy or slip > 0) or not np.isfinite(variance):
            return None
        slipping = np.broadcast_to(slip * np.eye(3), (len(origin), 3, 3))
        covariance = slipping if errors is None or not noisy else slipping + errors.shift_covariance(origin)
        return cls(covariance / variance, lasting)

    def in_body(self, attitude: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) in B of attitudes (n, 3, 3) R_C_B, for a frame by itself."""
        return np.asarray(np.swapaxes(attitude, 1, 2) @ self.covariance @ attitude)

    def among_all(self, attitude: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) in B of attitudes (n, 3, 3) R_C_B, in what all frames tell together."""
        return self.in_body(attitude) / self.lasting


def shifts_in(
    shifts: FrameShifts | None, index: IntArray | slice, count: FloatArray | None = None
) -> FrameShifts | None:
    """The shifts of some frames, if there are any shifts; count (k,): how many frames each of these stands for."""
    if shifts is None:
        return None
    covariance = shifts.covariance[index]
    return replace(shifts, covariance=covariance if count is None else covariance / count[:, None, None])
