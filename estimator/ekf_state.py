"""The state of the filters of `ekf`, a bank of them side by side, and what they measure.

A member's state is the path's u, the target's attitude, rate and inertia, and its features' points in B, origin at the
centre of mass. Attitude and inertia have multiplicative errors, see `ekf_motion.rotated`.
"""

from dataclasses import dataclass, fields

import numpy as np

from baryscope.estimator.ekf_motion import ROTATION
from baryscope.estimator.rotation import INERTIA_BASIS
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
        p, q = self.path.shape[1], self.path.shape[1] + ROTATION
        return State(
            self.path + change[:, :p],
            turned(self.quaternion, change[:, p : p + 3]),
            self.rate + change[:, p + 3 : p + 6],
            _heavier(self.inertia, change[:, p + 6 : q]),
            self.points + change[:, q:].reshape(self.points.shape),
            covariance,
        )


@dataclass(frozen=True, eq=False)
class Measured:
    """Positions (n, m, 3), m, and covariances (n, m, 3, 3), m², of what is seen and believed (n, m)."""

    position: FloatArray
    covariance: FloatArray
    seen: BoolArray


def turned(quaternion: FloatArray, turn: FloatArray) -> FloatArray:
    """Quaternions (k, 4), scalar first, turned by rotation vectors (k, 3) in B."""
    half = 0.5 * np.sqrt(np.einsum("ki,ki->k", turn, turn))
    (w, x, y, z), a = quaternion.T, np.cos(half)
    b, c, d = 0.5 * np.sinc(half / np.pi) * turn.T
    product = [
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    ]
    return np.stack(product, axis=1)


def _heavier(inertia: FloatArray, change: FloatArray) -> FloatArray:
    """A exp(Σ δ_i E_i) Aᵀ for A Aᵀ = inertia (k, 3, 3) and δ (k, 5)."""
    values, vectors = np.linalg.eigh(np.tensordot(change, INERTIA_BASIS, 1))
    root = np.linalg.cholesky(inertia) @ vectors * np.exp(np.clip(0.5 * values, -2.0, 2.0))[:, None]
    return np.asarray(root @ np.swapaxes(root, 1, 2))
