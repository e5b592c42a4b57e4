"""The update of the filters of `ekf` by a frame's observations: the iterated update, its gate, and new features.

The update is that of Bell and Cathey (IEEE TAC 38, 1993): Gauss–Newton steps, relinearised after each step.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.reweighting import GATE
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, attitude_of
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

MAX_ITERATIONS = 5  # of an update
LINEARISATION_TOLERANCE = 0.05  # of the last iteration, in standard deviations of an observation


@dataclass(frozen=True, eq=False)
class Update:
    """The results of an update of k members by the observations of c features.

    log_likelihood, total normalised square and number of values (k,) of the accepted innovations, jointly; squares
    (k, c): normalised square of each innovation; predicted (k, c, 3): predicted positions in C, m. Of the first member:
    follow (s, s), information (s, s) and rhs (s,), see `filter.Trace`.
    """

    log_likelihood: FloatArray
    total: FloatArray
    values: FloatArray
    squares: FloatArray
    predicted: FloatArray
    follow: FloatArray
    information: FloatArray
    rhs: FloatArray


def updated(
    state: State, process: PathProcess, frame: int, index: IntArray, measured: Measured, known: BoolArray, keep: bool
) -> tuple[State, Update]:
    """The state after an update by c features `index`; innovations beyond the gate are not used.

    known (k, c): the features that each member has initialised; only these are used.
    """
    P = state.covariance
    k, s = P.shape[:2]
    c = len(index)
    seen, noise, limit = _measurement(measured, frame, index)
    change, moved = np.zeros((k, s)), False
    for iteration in range(MAX_ITERATIONS):
        expected, by_errors = _linearised(state, change, process, frame, index)
        innovation = (seen - expected).reshape(k, 3 * c)
        if moved:
            innovation = innovation + (by_errors @ change[:, :, None])[:, :, 0]
        HP = by_errors @ P
        S = HP @ by_errors.transpose(0, 2, 1) + noise
        if iteration == 0:
            predicted, squares = expected, _own_squares(innovation.reshape(k, c, 3), S.reshape(k, c, 3, c, 3))
            accepted = (squares < GATE) & known
            all_accepted, mask = bool(accepted.all()), np.repeat(accepted, 3, axis=1)
        if not all_accepted:
            by_errors, innovation, HP = by_errors * mask[:, :, None], innovation * mask, HP * mask[:, :, None]
            S = np.where(mask[:, :, None] & mask[:, None], S, noise)
        precision = _solved(S, np.linalg.inv)
        whitened = (precision @ innovation[:, :, None])[:, :, 0]
        if iteration == 0:
            total = (innovation * whitened).sum(axis=1)
            # Rejected observations count as if they were at the gate, so that members are comparable.
            outside = GATE * (known & ~accepted).sum(axis=1)
            likelihood = -0.5 * (total + outside + np.linalg.slogdet(S)[1])
        before, change, moved = change, (whitened[:, None] @ HP)[:, 0], True
        if _linearisation_error(state, change - before, index) < limit:
            break
    finite = np.isfinite(change).all(axis=1)
    change[~finite], likelihood[~finite] = 0.0, -np.inf
    gain = HP.transpose(0, 2, 1) @ precision
    P = P - gain @ HP
    new = state.changed(change, 0.5 * (P + P.transpose(0, 2, 1)))
    follow = information = np.zeros((0, 0))
    if keep:
        follow = np.eye(s) - gain[0] @ by_errors[0]
        information = by_errors[0].T @ precision[0] @ by_errors[0]
    rhs = by_errors[0].T @ whitened[0]
    values = 3 * accepted.sum(axis=1, dtype=np.float64)
    return new, Update(likelihood, total, values, squares, predicted, follow, information, rhs)


def _measurement(measured: Measured, frame: int, index: IntArray) -> tuple[FloatArray, FloatArray, float]:
    """Positions (c, 3) of features, their joint covariance (3 c, 3 c), and the tolerance of the linearisation, m."""
    c = len(index)
    C = measured.covariance[frame, index]
    blocks = np.zeros((c, 3, c, 3))
    blocks[np.arange(c), :, np.arange(c)] = C
    limit = LINEARISATION_TOLERANCE * float(np.sqrt(C.trace(axis1=1, axis2=2).min() / 3))
    return measured.position[frame, index], blocks.reshape(3 * c, 3 * c), limit


def _linearised(
    state: State, change: FloatArray, process: PathProcess, frame: int, index: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Predicted positions (k, c, 3) of c features in C after a change (k, s), and their Jacobian (k, 3 c, s)."""
    k, p, c = len(change), state.path.shape[1], len(index)
    H = process.observed[frame]
    attitude = attitude_of(k)(state.quaternion, change[:, p : p + 3]).reshape(k, 3, 3)
    points = state.points[:, index] + change[:, p + ROTATION :].reshape(k, -1, 3)[:, index]
    origin = process.nominal[frame] + (state.path + change[:, :p]) @ H.T
    by_errors = np.zeros((k, c, 3, change.shape[1]))
    by_errors[..., :p] = H
    # R [b]×ᵀ by columns: cross products of the columns of R with the points.
    x, y, z = (points[:, :, axis, None] for axis in range(3))
    u, v, w = (attitude[:, None, :, axis] for axis in range(3))
    by_errors[..., p], by_errors[..., p + 1], by_errors[..., p + 2] = w * y - v * z, u * z - w * x, v * x - u * y
    own = by_errors[..., p + ROTATION :].reshape(k, c, 3, -1, 3)
    own[:, np.arange(c), :, index] = attitude
    by_errors[..., p + ROTATION :] = own.reshape(k, c, 3, -1)
    return origin[:, None] + points @ attitude.transpose(0, 2, 1), by_errors.reshape(k, 3 * c, -1)


def _own_squares(innovation: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised squares (k, c) of the innovations (k, c, 3) of single features; covariance (k, c, 3, c, 3)."""
    each = np.arange(innovation.shape[1])
    blocks = covariance[:, each, :, each]
    innovation = innovation.transpose(1, 0, 2)
    solved = _solved(blocks, np.linalg.solve, innovation[..., None])[..., 0]
    return np.asarray((innovation * solved).sum(axis=2).T)


def _solved(matrix: FloatArray, solve: Callable[..., FloatArray], *rhs: FloatArray) -> FloatArray:
    """The result of `solve` for matrices (..., p, p) and right-hand sides; NaN where a matrix is singular.

    Rounding can make the covariance of a diverging member singular.
    """
    try:
        return solve(matrix, *rhs)
    except np.linalg.LinAlgError:
        regular = np.linalg.slogdet(matrix)[0] != 0
        found = np.full_like(rhs[0] if rhs else matrix, np.nan)
        found[regular] = solve(matrix[regular], *(values[regular] for values in rhs))
        return found


def _linearisation_error(state: State, moved: FloatArray, index: IntArray) -> float:
    """A bound of the linearisation error, m: the rotation times a point's shift, plus its square times the distance."""
    k, p = len(moved), state.path.shape[1]
    turn = np.sqrt((moved[:, p : p + 3] ** 2).sum(axis=1))
    shift = np.abs(moved[:, p + ROTATION :].reshape(k, -1, 3)[:, index]).max(axis=(1, 2))
    left = turn * (turn * np.abs(state.points[:, index].reshape(k, -1)).max(axis=1) + shift)
    return float(left[np.isfinite(left)].max(initial=0.0))


def placed(
    state: State, process: PathProcess, frame: int, new: BoolArray, measured: Measured
) -> tuple[State, FloatArray]:
    """Initialise the points of features (k, m) at b = Rᵀ (y − g).

    Returns the state, and the transition (k, s, s) of its errors.
    """
    k, s = state.covariance.shape[:2]
    p = state.path.shape[1]
    R_B_C = np.swapaxes(matrix_from_quaternion(state.quaternion), 1, 2)
    origin = process.nominal[frame] + state.path @ process.observed[frame].T
    points = (measured.position[frame] - origin[:, None]) @ np.swapaxes(R_B_C, 1, 2)
    follow, noise = np.tile(np.eye(s), (k, 1, 1)), np.zeros((k, s, s))
    arms = cross_matrices(points.reshape(-1, 3)).reshape(k, -1, 3, 3)
    for member, feature in np.argwhere(new).tolist():
        first = p + ROTATION + 3 * feature
        own = slice(first, first + 3)
        follow[member, own] = 0.0
        follow[member, own, :p] = -R_B_C[member] @ process.observed[frame]
        follow[member, own, p : p + 3] = arms[member, feature]
        noise[member, own, own] = R_B_C[member] @ measured.covariance[frame, feature] @ R_B_C[member].T
    covariance = follow @ state.covariance @ np.swapaxes(follow, 1, 2) + noise
    return replace(state, points=np.where(new[:, :, None], points, state.points), covariance=covariance), follow
