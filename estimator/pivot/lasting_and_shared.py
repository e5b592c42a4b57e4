"""What is taken for given of errors that are not new in every observation, until the steps have converged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.position_noise import SIGNIFICANT, STILL, position_variance
from baryscope.estimator.camera.shared import SharedErrors
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

SLIP_TOLERANCE = 0.1  # relative change of the variance of a slipping position


@dataclass(frozen=True, eq=False)
class LastingAndShared:
    """What is taken for given of errors that are not new in every observation, until the steps have converged.

    lasting: how many frames have the same errors of the features; slip: the variance of a position that slips, m²;
    shifts: of the frames, None where there are none, for `told`, the variance of an observation of weight 1 in what all
    frames tell, m² or 1.
    """

    lasting: float
    slip: float = 0.0
    told: float = np.nan
    shifts: FrameShifts | None = None

    def at(self, errors: SharedErrors | None, origin: FloatArray, frame_variance: float) -> "LastingAndShared":
        """With the shifts at a path, origin (n, 3) in C, m, by noise of the camera's attitude and by slip.

        frame_variance: of an observation of weight 1 in a frame by itself.
        """
        shifts = FrameShifts.of(errors, origin, self.slip, frame_variance, self.lasting)
        return replace(self, told=self.lasting * frame_variance, shifts=shifts)

    def slipping(
        self, bodies: Sequence[Body], observations: Observations, origin: FloatArray, variance: float, *, slow: bool
    ) -> "LastingAndShared":
        """With the slip that a path, origin (n, 3) in C, m, leaves.

        variance: of an observation of weight 1; slow: whether slips may be slow, see `position_variance`.
        """
        significant = STILL if self.slip > 0 else SIGNIFICANT
        slip = position_variance(bodies, observations, origin, variance, self.lasting, significant, slow=slow)
        return replace(self, slip=slip)

    def slips_unlike(self, other: "LastingAndShared") -> bool:
        """Whether the slip is clearly another."""
        return abs(self.slip - other.slip) > SLIP_TOLERANCE * max(self.slip, other.slip)
