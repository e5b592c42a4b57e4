"""Screws: axis, angle and translation of a rigid displacement, and their closed form from a pair of poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import quaternion_from_matrix

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

LEAST_ANGLE = 1e-9  # rad, of a rotation that has an axis

# Status of a screw: SOUND (valid), or the reason why it is invalid.
SOUND, TOO_FEW_POINTS, TOO_LITTLE_ROTATION, DEGENERATE_POINTS, NOT_CONVERGED = range(5)
REASONS = (
    "sound",
    "fewer than three points in common",
    "too little rotation",
    "displacements do not determine the axis",
    "not converged",
)


@dataclass(frozen=True)
class Screws:
    """n screws.

    axis (n, 3), unit, with the sense of the rotation, so that angle (n,) in rad is in [0, π]; point (n, 3) in m, the
    point of the axis nearest to the centroid of the points before and after; translation (n,) in m along the axis;
    status (n,), one of the codes above, an index into REASONS. If it is not SOUND, all other values are NaN.
    """

    axis: FloatArray
    point: FloatArray
    angle: FloatArray
    translation: FloatArray
    status: IntArray

    @property
    def valid(self) -> NDArray[np.bool_]:
        """The valid screws, (n,)."""
        return np.asarray(self.status == SOUND)


def screws_or_nan(
    axis: FloatArray, point: FloatArray, angle: FloatArray, translation: FloatArray, status: IntArray
) -> Screws:
    """Screws with NaN where the status is not SOUND."""
    bad = status != SOUND
    return Screws(
        axis=np.where(bad[:, None], np.nan, axis),
        point=np.where(bad[:, None], np.nan, point),
        angle=np.where(bad, np.nan, angle),
        translation=np.where(bad, np.nan, translation),
        status=status,
    )


def screws_of_poses(R_C_S1: FloatArray, centre_1: FloatArray, R_C_S2: FloatArray, centre_2: FloatArray) -> Screws:
    """The screws from pose 1 to pose 2; rotations (n, 3, 3), centres (n, 3) in C, m, of the same body point.

    Axis and angle come from the quaternion of R₂ R₁ᵀ, which is accurate up to and at 180°, where R − Rᵀ vanishes. The
    point is the chord's midpoint plus ½ cot(θ/2) a × d⊥, d the chord of the centre. Screws with an angle up to
    LEAST_ANGLE have the status TOO_LITTLE_ROTATION.
    """
    quaternion = quaternion_from_matrix(R_C_S2 @ np.swapaxes(R_C_S1, 1, 2))
    quaternion = np.where(quaternion[:, :1] < 0, -quaternion, quaternion)
    length = np.linalg.norm(quaternion[:, 1:], axis=1)
    angle = 2 * np.arctan2(length, quaternion[:, 0])
    turned = (length > 0) & (angle > LEAST_ANGLE)
    axis = quaternion[:, 1:] / np.where(turned, length, 1.0)[:, None]
    chord = centre_2 - centre_1
    translation = np.einsum("ni,ni->n", axis, chord)
    half_cotangent = 0.5 * quaternion[:, 0] / np.where(turned, length, 1.0)
    point = 0.5 * (centre_1 + centre_2) + half_cotangent[:, None] * np.cross(axis, chord)
    status = np.where(turned, SOUND, TOO_LITTLE_ROTATION)
    return screws_or_nan(axis, point, angle, translation, status)
