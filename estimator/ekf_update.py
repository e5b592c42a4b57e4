"""What the sightings of a frame do to the filters of `ekf`: the iterated update, its gate, and new features.

The update is Bell's and Cathey's (IEEE TAC 38, 1993): Gauss–Newton steps, each about where the one before led.
"""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.alignment import matrix_from_quaternion
from baryscope.estimator.ekf_motion import ROTATION, PathProcess
from baryscope.estimator.ekf_state import Measured, State, turned
from baryscope.estimator.robust import GATE
from baryscope.estimator.sightings import cross_matrices
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

ITERATIONS = 5  # of an update at most
SETTLED = 0.05  # deviations of a sighting that the last iteration may leave out


@dataclass(frozen=True, eq=False)
class Update:
    """What the sightings of c features told k members.

    log_likelihood, total normalised square and values (k,): of all innovations together, without those beyond the gate;
    squares (k, c): of each by itself; foretold (k, c, 3): where they were expected, m in C. Of the first member: how
    errors follow those before, (s, s), with `information` (s, s) and `side` (s,), see `ekf_filter.Trace`.
    """

    log_likelihood: FloatArray
    total: FloatArray
    values: FloatArray
    squares: FloatArray
    foretold: FloatArray
    follow: FloatArray
    information: FloatArray
    side: FloatArray


def updated(
    state: State, process: PathProcess, frame: int, index: IntArray, measured: Measured, keep: bool
) -> tuple[State, Update]:
    """The state after the sightings of features `index`, without those whose innovation lies beyond the gate."""
    P = state.covariance
    k, s = P.shape[:2]
    c = len(index)
    seen, C = measured.position[frame, index], measured.covariance[frame, index]
    blocks = np.zeros((c, 3, c, 3))
    blocks[np.arange(c), :, np.arange(c)] = C
    noise = blocks.reshape(3 * c, 3 * c)
    limit = SETTLED * float(np.sqrt(np.einsum("cii->c", C).min() / 3))
    change = np.zeros((k, s))
    for iteration in range(ITERATIONS):
        expected, by_errors = _linearised(state, change, process, frame, index)
        innovation = (seen - expected).reshape(k, 3 * c) + (by_errors @ change[:, :, None])[:, :, 0]
        if iteration == 0:
            HP = by_errors @ P
            S = HP @ np.swapaxes(by_errors, 1, 2) + noise
            squares = _own_squares(innovation.reshape(k, c, 3), S.reshape(k, c, 3, c, 3))
            accepted = np.repeat(squares < GATE, 3, axis=1)
            foretold = expected
        by_errors = by_errors * accepted[:, :, None]
        innovation = innovation * accepted
        HP = by_errors @ P
        S = HP @ np.swapaxes(by_errors, 1, 2) + noise
        precision = np.linalg.inv(S)
        whitened = (precision @ innovation[:, :, None])[:, :, 0]
        if iteration == 0:
            total = np.einsum("ki,ki->k", innovation, whitened)
            # What is not accepted counts as if it lay on the gate, so that members can be compared.
            outside = GATE * (squares >= GATE).sum(axis=1)
            likelihood = -0.5 * (total + outside + np.linalg.slogdet(S)[1])
        before, change = change, (whitened[:, None] @ HP)[:, 0]
        if _left_out(state, change - before, index) < limit:
            break
    sound = np.isfinite(change).all(axis=1)
    change[~sound], likelihood[~sound] = 0.0, -np.inf
    gain = np.swapaxes(HP, 1, 2) @ precision
    P = P - gain @ HP
    new = state.changed(change, 0.5 * (P + np.swapaxes(P, 1, 2)))
    follow, information = np.eye(s), np.zeros((s, s))
    if keep:
        follow = follow - gain[0] @ by_errors[0]
        information = by_errors[0].T @ precision[0] @ by_errors[0]
    side = by_errors[0].T @ whitened[0]
    return new, Update(likelihood, total, accepted.sum(axis=1), squares, foretold, follow, information, side)


def _linearised(
    state: State, change: FloatArray, process: PathProcess, frame: int, index: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Where c features are expected, (k, c, 3) in C, at a change, and how that depends on the errors, (k, 3 c, s)."""
    k, p, c = len(change), state.path.shape[1], len(index)
    own = p + ROTATION + 3 * index[:, None] + np.arange(3)
    attitude = matrix_from_quaternion(turned(state.quaternion, change[:, p : p + 3]))
    points = state.points[:, index] + change[:, own]
    origin = process.nominal[frame] + (state.path + change[:, :p]) @ process.observed[frame].T
    by_errors = np.zeros((k, c, 3, change.shape[1]))
    by_errors[..., :p] = process.observed[frame]
    by_errors[..., p : p + 3] = -attitude[:, None] @ cross_matrices(points.reshape(-1, 3)).reshape(k, c, 3, 3)
    by_errors[:, np.arange(c)[:, None], :, own] = attitude.transpose(2, 0, 1)
    return origin[:, None] + points @ np.swapaxes(attitude, 1, 2), by_errors.reshape(k, 3 * c, -1)


def _own_squares(innovation: FloatArray, covariance: FloatArray) -> FloatArray:
    """Normalised squares (k, c) of each feature's innovation (k, c, 3) by itself; covariance (k, c, 3, c, 3)."""
    blocks = np.einsum("kcicj->kcij", covariance)
    return np.asarray(np.einsum("kci,kci->kc", innovation, np.linalg.solve(blocks, innovation[..., None])[..., 0]))


def _left_out(state: State, moved: FloatArray, index: IntArray) -> float:
    """What the last linearisation left out at most, m: a turn times a point's move, or its own square."""
    k, p = len(moved), state.path.shape[1]
    turn = np.linalg.norm(moved[:, p : p + 3], axis=1)
    shift = np.abs(moved[:, p + ROTATION :].reshape(k, -1, 3)[:, index]).max(axis=(1, 2))
    left = turn * (turn * np.abs(state.points[:, index]).max(axis=(1, 2)) + shift)
    return float(left[np.isfinite(left)].max(initial=0.0))


def placed(
    state: State, process: PathProcess, frame: int, fresh: BoolArray, measured: Measured
) -> tuple[State, FloatArray]:
    """Put features (k, m) where they are seen, b = Rᵀ (y − g); also how errors follow those before, (k, s, s)."""
    k, s = state.covariance.shape[:2]
    p = state.path.shape[1]
    R_B_C = np.swapaxes(matrix_from_quaternion(state.quaternion), 1, 2)
    origin = process.nominal[frame] + state.path @ process.observed[frame].T
    points = (measured.position[frame] - origin[:, None]) @ np.swapaxes(R_B_C, 1, 2)
    follow, noise = np.tile(np.eye(s), (k, 1, 1)), np.zeros((k, s, s))
    arms = cross_matrices(points.reshape(-1, 3)).reshape(k, -1, 3, 3)
    for member, feature in np.argwhere(fresh).tolist():
        first = p + ROTATION + 3 * feature
        own = slice(first, first + 3)
        follow[member, own] = 0.0
        follow[member, own, :p] = -R_B_C[member] @ process.observed[frame]
        follow[member, own, p : p + 3] = arms[member, feature]
        noise[member, own, own] = R_B_C[member] @ measured.covariance[frame, feature] @ R_B_C[member].T
    covariance = follow @ state.covariance @ np.swapaxes(follow, 1, 2) + noise
    return replace(state, points=np.where(fresh[:, :, None], points, state.points), covariance=covariance), follow
