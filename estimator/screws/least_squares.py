"""screw-ls: the least-squares baseline. CasADi fits a screw to all features of each pair of frames.

Unknowns of a pair: two small rotations of the axis, two shifts of the pole in the plane normal to it, the angle and the
translation. A damped Gauss–Newton step (Levenberg–Marquardt) is one CasADi function, evaluated for all pairs at once.
"""

from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.screws.motion import Pairs
from baryscope.estimator.screws.screws import (
    LEAST_ANGLE,
    NOT_CONVERGED,
    SOUND,
    TOO_FEW_POINTS,
    TOO_LITTLE_ROTATION,
    Screws,
    screws_or_nan,
)
from baryscope.models.columns import ColumnFunction

FloatArray = NDArray[np.float64]

MAX_STEPS = 160  # most pairs converge after five or six; each step has only the others
TOLERANCE = 1e-10  # of the last step, in rad and relative to the points' rms radius
UNKNOWNS = 6


def screws(pairs: Pairs) -> Screws:
    """Least-squares screws from all features seen in both frames; the status tells which have not converged."""
    before, after, weights = _common_points(pairs)
    return least_squares_screws(before, after, weights)


def least_squares_screws(before: FloatArray, after: FloatArray, weights: FloatArray) -> Screws:
    """The k least-squares screws from points before (k, m, 3) to after (k, m, 3) in m; weights (k, m), 0 = not seen."""
    sufficient = (weights > 0).sum(axis=1) >= 3
    w = np.where(sufficient[:, None], weights, 1.0)
    total = w.sum(axis=1)[:, None]
    before, after = np.nan_to_num(before), np.nan_to_num(after)
    origin = np.einsum("kmi,km->ki", before + after, w) / (2 * total)
    p, q = before - origin[:, None], after - origin[:, None]
    size = np.sqrt(np.einsum("km,kmi,kmi->k", w, p, p) / total[:, 0])
    size = np.where(size > 0, size, 1.0)
    # In units of the points' rms radius all six unknowns are of the order of one.
    p, q = p / size[:, None, None], q / size[:, None, None]
    state, converged = _iterate(_start(p, q, w), p, q, w)
    axis, pole, angle, translation = state[:, :3], state[:, 3:6], state[:, 6], state[:, 7]
    pole = pole - np.einsum("ki,ki->k", pole, axis)[:, None] * axis
    angle = np.arctan2(np.sin(angle), np.cos(angle))
    sign = np.where(angle < 0, -1.0, 1.0)
    status = np.full(len(p), SOUND)
    status[~converged] = NOT_CONVERGED
    status[np.abs(angle) < LEAST_ANGLE] = TOO_LITTLE_ROTATION
    status[~sufficient] = TOO_FEW_POINTS
    return screws_or_nan(
        sign[:, None] * axis, origin + size[:, None] * pole, np.abs(angle), sign * size * translation, status
    )


def _common_points(pairs: Pairs) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (k, m, 3) before and after, those of features seen in both frames first; weights (k, m), 1 for these."""
    position = pairs.motion.position
    before, after = position[pairs.first], position[pairs.second]
    both = ~np.isnan(before[..., 0]) & ~np.isnan(after[..., 0])
    order = np.argsort(~both, axis=1, kind="stable")[:, : max(int(both.sum(axis=1).max(initial=3)), 3), None]
    weights = np.take_along_axis(both, order[..., 0], axis=1).astype(np.float64)
    return np.take_along_axis(before, order, axis=1), np.take_along_axis(after, order, axis=1), weights


def _start(p: FloatArray, q: FloatArray, w: FloatArray) -> FloatArray:
    """Initial states (k, 9): axis, pole, angle, translation, damping.

    The axis is the direction of Σ p × q, and the angle the rotation of the points about it: an approximation, not the
    closed-form solution. Near 180° the sum vanishes and the axis is arbitrary; the damping makes the steps converge.
    """
    weight = (w / w.sum(axis=1, keepdims=True))[..., None]
    centre_p, centre_q = (weight * p).sum(axis=1), (weight * q).sum(axis=1)
    arm_p, arm_q = p - centre_p[:, None], q - centre_q[:, None]
    cross = (weight * np.cross(arm_p, arm_q)).sum(axis=1) + np.array([1e-9, 2e-9, 3e-9])
    axis = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    along = np.einsum("kmi,ki->km", arm_p, axis) * np.einsum("kmi,ki->km", arm_q, axis)
    cosine = (weight[..., 0] * (np.einsum("kmi,kmi->km", arm_p, arm_q) - along)).sum(axis=1)
    sine = np.einsum("ki,ki->k", cross, axis)
    angle = np.clip(np.arctan2(sine, cosine), 0.1, 3.0)
    chord = centre_q - centre_p
    translation = np.einsum("ki,ki->k", axis, chord)
    pole = 0.5 / np.tan(angle / 2)[:, None] * np.cross(axis, chord)
    return np.column_stack([axis, pole, angle, translation, np.full(len(p), 1e-3)])


def _iterate(state: FloatArray, p: FloatArray, q: FloatArray, w: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """States and convergence of all pairs after damped Gauss–Newton steps; converged pairs leave the iteration."""
    converged = np.zeros(len(p), dtype=bool)
    step, columns = _step_function(w.shape[1]), [one.reshape(len(p), -1).T for one in (p, q, w)]
    for _ in range(MAX_STEPS):
        active = np.nonzero(~converged)[0]
        if not active.size:
            break
        with np.errstate(all="ignore"):  # points that determine no screw may lead anywhere: they do not converge
            new = step(state[active].T, *(one[:, active] for one in columns))
        state[active], converged[active] = new[:, :9], new[:, 9] < TOLERANCE
    return state, converged


@cache
def _step_function(m: int) -> ColumnFunction:
    """One Levenberg–Marquardt step: (state (9), p (3m), q (3m), w (m)) → (state, size of the step)."""
    state = ca.SX.sym("state", 9)
    p, q, w = ca.SX.sym("p", 3 * m), ca.SX.sym("q", 3 * m), ca.SX.sym("w", m)
    x = ca.SX.sym("x", UNKNOWNS)
    trial = _moved(state, x)
    root = ca.sqrt(w)
    residual = ca.vertcat(*(root[i] * (_image(trial, p[3 * i : 3 * i + 3]) - q[3 * i : 3 * i + 3]) for i in range(m)))
    at = ca.Function("residual", [x, state, p, q, w], [residual, ca.jacobian(residual, x)])
    r, jacobian = at(ca.SX.zeros(UNKNOWNS), state, p, q, w)
    normal, gradient = jacobian.T @ jacobian, jacobian.T @ r
    damping = state[8]
    dx = -ca.ldl_solve(gradient, *ca.ldl(normal + damping * ca.diag(ca.diag(normal) + 1e-9), False))
    r_new, _ = at(dx, state, p, q, w)
    size = ca.norm_2(dx)
    before, after = ca.sumsqr(r), ca.sumsqr(r_new)
    # At the minimum the difference of the costs is rounding error, so short steps are always taken.
    better = ca.logic_or(after < before, size < 1e-6)
    moved = _moved(state, dx)
    kept = ca.vertcat(state[:8], damping * 10)
    taken = ca.vertcat(moved[:8], ca.fmax(damping / 10, 1e-15))
    found = ca.vertcat(ca.if_else(better, taken, kept), ca.if_else(better, size, 1.0))
    return ColumnFunction("step", [state, p, q, w], found)


def _moved(state: ca.SX, x: ca.SX) -> ca.SX:
    """The state with the axis rotated by x₀, x₁, the pole shifted by x₂, x₃, and x₄, x₅ added to angle, translation."""
    axis = state[:3]
    # Tangents from the cross product with a coordinate axis that is not near the screw axis.
    far_from_x = ca.fabs(axis[0]) < 0.6
    helper = ca.vertcat(ca.if_else(far_from_x, 1.0, 0.0), ca.if_else(far_from_x, 0.0, 1.0), 0.0)
    one = ca.cross(axis, helper)
    one = one / ca.norm_2(one)
    two = ca.cross(axis, one)
    turned = axis + x[0] * one + x[1] * two
    pole = state[3:6] + x[2] * one + x[3] * two
    return ca.vertcat(turned / ca.norm_2(turned), pole, state[6] + x[4], state[7] + x[5], state[8])


def _image(state: ca.SX, point: ca.SX) -> ca.SX:
    """The image of a point under a screw: u + R(a, θ)(p − u) + τ a, by Rodrigues' formula."""
    axis, pole, angle, translation = state[:3], state[3:6], state[6], state[7]
    arm = point - pole
    across = ca.cross(axis, arm)
    return point + ca.sin(angle) * across + (1 - ca.cos(angle)) * ca.cross(axis, across) + translation * axis
