"""The state of the filters of `ekf`, a bank of them side by side, and what they measure.

A member's state is the path's u, the target's attitude, rate and inertia, and its features' points in B, origin at the
centre of mass. Attitude and inertia have multiplicative errors, see `motion.rotated`.
"""

from dataclasses import dataclass, fields

from baryscope.estimator.ekf.motion import ROTATION, changed_of
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class State:
    """k members.

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
        """Some of the members, in an order."""
        return State(*(getattr(self, part.name)[members] for part in fields(self)))

    def changed(self, change: FloatArray, covariance: FloatArray) -> "State":
        """With the errors `change` (k, s) taken out."""
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
    """Positions (n, m, 3), m, and covariances (n, m, 3, 3), m², of what is seen and an inlier (n, m)."""

    position: FloatArray
    covariance: FloatArray
    seen: BoolArray
