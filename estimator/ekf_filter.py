"""The filter of `ekf`: a bank of iterated extended Kalman filters, side by side, over the sightings of one target."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.ekf_motion import ROTATION, PathProcess, rotated
from baryscope.estimator.ekf_state import Measured, State
from baryscope.estimator.ekf_update import placed, updated
from baryscope.estimator.robust import GATE
from baryscope.estimator.tracks import FloatArray

RENEWED = 8  # sightings of a feature in a row that do not fit, after which it is placed anew
LOST = np.pi  # rad, deviation of the attitude with which it is not known any more
LONGEST = 100.0  # trace of an inertia that began with 1 and keeps its determinant: far beyond any body, but for a start
FASTEST = 10.0  # times the rate at first, three deviations added


@dataclass(frozen=True, eq=False)
class Noise:
    """Process noise of k members: covariance of the path's steps, (k, n - 1, p, p), and density of the angular
    acceleration, (k,), rad²/s³; pull (k, n - 1, 3): of the gravity gradient, see `ekf_motion.rotated`.
    """

    path: FloatArray
    turn: FloatArray
    pull: FloatArray


@dataclass(frozen=True, eq=False)
class Trace:
    """What a smoother needs of a frame.

    Before its sightings: how path and rotation got there, (p + 11, p + 11), and the path's covariance with all errors,
    (p, s). How errors after them follow those before, (s, s), and the information (s, s) and side (s,) that they bring.
    """

    moved: FloatArray
    covariance: FloatArray
    follow: FloatArray
    information: FloatArray
    side: FloatArray


@dataclass(frozen=True, eq=False)
class Run:
    """How a bank of k fared.

    state at the last frame; log_likelihood (k,) of the innovations, −∞ for members that went astray; squares (k, n, m):
    normalised squared innovations of the sightings, each by itself, NaN where there are none; foretold (k, n, m, 3):
    where they were expected, m in C; nis (k,): mean normalised innovation squared of all accepted values, 1 is
    expected; traces, of the first member, if they are kept.
    """

    state: State
    log_likelihood: FloatArray
    squares: FloatArray
    foretold: FloatArray
    nis: FloatArray
    traces: tuple[Trace, ...]

    def only(self, member: int) -> "Run":
        """That of one member."""
        one = np.array([member])
        return Run(
            self.state.where(one),
            self.log_likelihood[one],
            self.squares[one],
            self.foretold[one],
            self.nis[one],
            self.traces,
        )


def run_filter(
    state: State,
    first: int,
    time: FloatArray,
    process: PathProcess,
    noise: Noise,
    measured: Measured,
    keep: bool = False,
) -> Run:
    """Run the bank over the frames from `first` on, at whose time the state is; keep: the first member's traces."""
    n, m = measured.seen.shape
    k, s = state.covariance.shape[:2]
    likelihood, total, values = np.zeros(k), np.zeros(k), np.zeros(k)
    squares, foretold, traces = np.full((k, n, m), np.nan), np.full((k, n, m, 3), np.nan), []
    known, missed = np.zeros(m, dtype=bool), np.zeros((k, m), dtype=np.intp)
    p, moved = state.path.shape[1], np.eye(state.path.shape[1] + ROTATION)
    slack = 3 * np.sqrt(np.einsum("kii->ki", state.covariance)[:, p + 3 : p + 6].max())
    fastest = FASTEST * (float(np.linalg.norm(state.rate, axis=1).max()) + float(slack))
    for frame in range(first, n):
        if frame > first:
            dt = float(time[frame] - time[frame - 1])
            with np.errstate(over="ignore", invalid="ignore"):  # of members that go astray
                state, moved = _predicted(state, frame - 1, dt, process, noise)
            state = _without_astray(state, likelihood, fastest)
        trace = Trace(moved, state.covariance[0, :p], np.eye(s), np.zeros((s, s)), np.zeros(s))
        old = np.nonzero(measured.seen[frame] & known)[0]
        if len(old):
            state, update = updated(state, process, frame, old, measured, keep)
            likelihood += update.log_likelihood
            total, values = total + update.total, values + update.values
            squares[:, frame, old], foretold[:, frame, old] = update.squares, update.foretold
            missed[:, old] = np.where(update.squares < GATE, 0, missed[:, old] + 1)
            trace = replace(trace, follow=update.follow, information=update.information, side=update.side)
        fresh = measured.seen[frame] & ((missed >= RENEWED) | ~known)
        if fresh.any():
            state, follow = placed(state, process, frame, fresh, measured)
            trace = replace(trace, follow=follow[0] @ trace.follow)
            missed[fresh] = 0
            known |= fresh.any(axis=0)
        if keep:
            traces.append(trace)
        state = _without_astray(state, likelihood, fastest)
        if not np.isfinite(likelihood).any():
            break
    return Run(state, likelihood, squares, foretold, total / np.maximum(values, 1.0), tuple(traces))


def _without_astray(state: State, log_likelihood: FloatArray, fastest: float) -> State:
    """Members that have gone astray go on as copies of one that has not, their log_likelihood (k,) −∞ from now on."""
    p = state.path.shape[1]
    turn = np.einsum("kii->ki", state.covariance)[:, p : p + 3]
    sound = (turn < LOST**2).all(axis=1) & (np.trace(state.inertia, axis1=1, axis2=2) < LONGEST)
    sound &= np.isfinite(log_likelihood) & (np.abs(state.rate).max(axis=1) < fastest)
    log_likelihood[~sound] = -np.inf
    if sound.all() or not sound.any():
        return state
    return state.where(np.where(sound, np.arange(len(sound)), np.argmax(sound)))


def _predicted(state: State, step: int, dt: float, process: PathProcess, noise: Noise) -> tuple[State, FloatArray]:
    """One frame on, dt in s; and how the errors of path and rotation of the first member moved."""
    p, q = state.path.shape[1], state.path.shape[1] + ROTATION
    transition = process.transition[step]
    quaternion, rate, change = rotated(state.quaternion, state.rate, state.inertia, noise.pull[:, step], dt)
    follow = np.zeros((len(rate), q, q))
    follow[:, :p, :p] = transition
    follow[:, p:, p:] = change
    P = state.covariance.copy()
    P[:, :q] = follow @ P[:, :q]
    P[:, :, :q] = P[:, :, :q] @ np.swapaxes(follow, 1, 2)
    P[:, :p, :p] += noise.path[:, step]
    turning = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    P[:, p : p + 6, p : p + 6] += noise.turn[:, None, None] * np.kron(turning, np.eye(3))
    moved = replace(state, path=state.path @ transition.T, quaternion=quaternion, rate=rate, covariance=P)
    return moved, follow[0]
