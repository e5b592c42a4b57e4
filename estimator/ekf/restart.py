"""Restart of the filters of `ekf` with a attitude_lost attitude, by registration of the known features.

After a gap the error of the predicted attitude may be radians if rate and inertia are poor, and the gate then rejects
all observations. Path, inertia and features are kept; attitude and rate get initial values and covariances.
"""

from dataclasses import replace

import numpy as np

from baryscope.estimator.adjustment.reweighting import GATE
from baryscope.estimator.ekf.motion import ROTATION
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

MIN_FEATURES = 3  # that determine an attitude
OFF_LINE = 5.0  # standard deviations of an observation that the features must lie off a line
INITIAL_ATTITUDE_DEVIATION = 1.0  # rad, standard deviation of a registered attitude before the update


def restarted(
    state: State,
    frame: int,
    index: IntArray,
    measured: Measured,
    known: BoolArray,
    attitude_lost: BoolArray,
    max_rate: float,
) -> tuple[State, BoolArray, FloatArray]:
    """The state with new attitudes for the members `attitude_lost` (k,), from c features, those known (k, c).

    max_rate: standard deviation of the new rate, rad/s.

    Returns:
        the state; the members (k,) with a new attitude, which the others' observations do not determine; and the
        transition (s, s) of the first member's errors.
    """
    p, s = state.path.shape[1], state.covariance.shape[1]
    quaternion, P = state.quaternion.copy(), state.covariance.copy()
    found, pick = np.zeros(len(attitude_lost), dtype=bool), np.eye(s)
    for member in np.nonzero(attitude_lost)[0].tolist():
        own = index[known[member]]
        attitude = _registered(state, member, frame, own, measured) if len(own) >= MIN_FEATURES else None
        if attitude is None:
            continue
        found[member], quaternion[member] = True, attitude
        P[member, p : p + 6], P[member, :, p : p + 6] = 0.0, 0.0
        P[member, p : p + 6, p : p + 6] = np.diag(np.repeat([INITIAL_ATTITUDE_DEVIATION**2, max_rate**2], 3))
        if member == 0:
            pick[p : p + 6] = 0.0
    return replace(state, quaternion=quaternion, covariance=P), found, pick


def _registered(state: State, member: int, frame: int, own: IntArray, measured: Measured) -> FloatArray | None:
    """The quaternion (4,) that aligns a member's points with their observations, None if it is undetermined or poor."""
    points, p = state.points[member, own], state.path.shape[1]
    rows = p + ROTATION + 3 * own[:, None] + np.arange(3)
    variance = measured.covariance[frame, own].trace(axis1=1, axis2=2) / 3
    of_points = state.covariance[member, rows, rows].mean(axis=1)
    fitted = align(measured.position[frame, own][None], points, (1 / variance)[None])
    residual = measured.position[frame, own] - fitted.translation[0] - points @ fitted.rotation[0].T
    fits = (residual**2).sum(axis=1) < GATE * (variance + of_points)
    determined = fitted.spread[0] > OFF_LINE**2 * float(variance.max())
    return np.asarray(fitted.quaternion[0]) if determined and fits.all() else None
