"""The state of the bank of filters of `ekf`, and its measurements.

A member's state is the path's u, the target's attitude, rate and inertia, and the features' points in B, with origin at
the centre of mass. Attitude and inertia have multiplicative errors, see `motion.rotated`.
"""

from dataclasses import dataclass, fields

from baryscope.estimator.ekf.motion import ROTATION, changed_of
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class State:
    """The state of k members.

    path (k, p): u; quaternion (k, 4) R_C_B, scalar first; rate (k, 3), rad/s in B; inertia (k, 3, 3), up to scale;
    points (k, m, 3), m in B; covariance (k, s, s) of the errors of path, turn, rate, inertia (5) and points, in this
    order.
    """

    path: FloatArray
    quaternion: FloatArray
    rate: FloatArray
    inertia: FloatArray
    points: FloatArray
    covariance: FloatArray

    def where(self, members: IntArray) -> "State":
        """The state of some members, in the given order."""
        return State(*(getattr(self, part.name)[members] for part in fields(self)))

    def changed(self, change: FloatArray, covariance: FloatArray) -> "State":
        """The state corrected by `change` (k, s), with a new covariance."""
        k, p = self.path.shape
        q = p + ROTATION
        rotation = changed_of(k)(self.quaternion, self.rate, self.inertia.reshape(k, 9), change[:, p:q])
        return State(
            self.path + change[:, :p],
            rotation[:, :4],
            rotation[:, 4:7],
            rotation[:, 7:].reshape(k, 3, 3),
            self.points + change[:, q:].reshape(self.points.shape),
            covariance,
        )


@dataclass(frozen=True, eq=False)
class Measured:
    """Positions (n, m, 3) in C, m, covariances (n, m, 3, 3), m², and seen (n, m): which are observed and inliers."""

    position: FloatArray
    covariance: FloatArray
    seen: BoolArray
