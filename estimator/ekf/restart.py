"""How the filters of `ekf` find the attitude again: by registration of the features that they know.

After a gap the predicted attitude may be off by radians where rate and inertia were poor: then the gate rejects all
that is seen. Path, inertia and features stay as they are; attitude and rate begin anew, as uncertain as at a first
sight.
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.adjustment.reweighting import GATE
from baryscope.estimator.ekf.motion import ROTATION
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

LEAST = 3  # features that tell an attitude
OFF_LINE = 5.0  # deviations of an observation that features must lie off a line
TURN = 1.0  # rad, deviation of an attitude that is registered, before what is seen is weighed in


def restarted(
    state: State, frame: int, index: IntArray, measured: Measured, told: BoolArray, lost: BoolArray, pace: float
) -> tuple[State, BoolArray, FloatArray]:
    """The state of `lost` members (k,) with attitudes from the observations of c features, those `told` (k, c).

    Returns:
        the state; which members (k,) it holds for: the others see too little, or no body that they know; and how the
        first member's errors follow those before, (s, s).
    """
    p, s = state.path.shape[1], state.covariance.shape[1]
    quaternion, P = state.quaternion.copy(), state.covariance.copy()
    found, pick = np.zeros(len(lost), dtype=bool), np.eye(s)
    for member in np.nonzero(lost)[0].tolist():
        own = index[told[member]]
        attitude = _registered(state, member, frame, own, measured) if len(own) >= LEAST else None
        if attitude is None:
            continue
        found[member], quaternion[member] = True, attitude
        P[member, p : p + 6], P[member, :, p : p + 6] = 0.0, 0.0
        P[member, p : p + 6, p : p + 6] = np.diag(np.repeat([TURN**2, pace**2], 3))
        if member == 0:
            pick[p : p + 6] = 0.0
    return replace(state, quaternion=quaternion, covariance=P), found, pick


def _registered(state: State, member: int, frame: int, own: IntArray, measured: Measured) -> FloatArray | None:
    """The quaternion by which points of a member are seen, None if they are not."""
    points, p = state.points[member, own], state.path.shape[1]
    rows = p + ROTATION + 3 * own[:, None] + np.arange(3)
    variance = measured.covariance[frame, own].trace(axis1=1, axis2=2) / 3
    of_points = state.covariance[member, rows, rows].mean(axis=1)
    fitted = align(measured.position[frame, own][None], points, (1 / variance)[None])
    missed = measured.position[frame, own] - fitted.translation[0] - points @ fitted.rotation[0].T
    fits = (missed**2).sum(axis=1) < GATE * (variance + of_points)
    clear = fitted.spread[0] > OFF_LINE**2 * float(variance.max())
    return np.asarray(fitted.quaternion[0]) if clear and fits.all() else None
