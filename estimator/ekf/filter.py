"""The filter of `ekf`: a bank of iterated extended Kalman filters, side by side, over one target's observations."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.reweighting import GATE
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, rotated
from baryscope.estimator.ekf.restart import restarted
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.ekf.update import placed, updated
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

RENEWED = 8  # observations of a feature in a row that do not fit, after which it is placed anew
UNSURE = 1.0  # rad, deviation of the attitude with which nothing can be predicted, and an observation tells nothing
LEAST = 3  # observations that tell an attitude
LONGEST = 100.0  # trace of an inertia that began with 1 and keeps its determinant: far beyond any body, but for a start
FASTEST = 10.0  # times the rate at first, three deviations added


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Process noise of k members.

    unit (o, n - 1, p, p): covariances of the path's steps that carry it off by 1 m; which (k,) of them each member has;
    path (k,): and how many m²; turn (k,): density of the angular acceleration, rad²/s³; gravity_gradient (k, n - 1, 3):
    of the gravity gradient, see `motion.rotated`.
    """

    unit: FloatArray
    which: IntArray
    path: FloatArray
    turn: FloatArray
    gravity_gradient: FloatArray

    def of_path(self, member: int) -> FloatArray:
        """The covariance of the steps of a member's path, (n - 1, p, p)."""
        return np.asarray(self.path[member] * self.unit[self.which[member]])


@dataclass(frozen=True, eq=False)
class Trace:
    """What a smoother needs of a frame.

    Before its observations: how path and rotation got there, (p + 11, p + 11), and the path's covariance with all
    errors, (p, s). How errors after them follow those before, (s, s), and the information (s, s) and rhs (s,) that they
    bring.
    """

    moved: FloatArray
    covariance: FloatArray
    follow: FloatArray
    information: FloatArray
    rhs: FloatArray

    def after(self, pick: FloatArray) -> "Trace":
        """Where errors before the observations were changed by pick (s, s) first."""
        return replace(
            self,
            follow=self.follow @ pick,
            information=pick.T @ self.information @ pick,
            rhs=pick.T @ self.rhs,
        )


@dataclass(frozen=True, eq=False)
class Run:
    """How a bank of k fared.

    state at the last frame; log_likelihood (k,) of the innovations, −∞ for members that went astray; squares (k, n, m):
    normalised squared innovations of the observations, each by itself, NaN where there are none; predicted (k, n, m,
    3): where they were expected, m in C; nis (k,): mean normalised innovation squared of all accepted values, 1 is
    expected; restarts (k,): how often attitude and rate were taken from the observations anew; traces, of the first
    member, if they are kept.
    """

    state: State
    log_likelihood: FloatArray
    squares: FloatArray
    predicted: FloatArray
    nis: FloatArray
    restarts: IntArray
    traces: tuple[Trace, ...]

    def only(self, member: int) -> "Run":
        """That of one member."""
        one = np.array([member])
        return Run(
            self.state.where(one),
            self.log_likelihood[one],
            self.squares[one],
            self.predicted[one],
            self.nis[one],
            self.restarts[one],
            self.traces,
        )


@dataclass(eq=False)
class _Bank:
    """A bank of k at work: its state, how it has fared so far, see `Run`, and the features (k, m) that each knows.

    missed (k, m): observations in a row that did not fit; pace: how fast the target turns at most at first, rad/s.
    """

    state: State
    log_likelihood: FloatArray
    squares: FloatArray
    predicted: FloatArray
    total: FloatArray
    values: FloatArray
    restarts: IntArray
    known: BoolArray
    missed: IntArray
    pace: float


def run_filter(
    state: State,
    frames: range,
    time: FloatArray,
    process: PathProcess,
    noise: ProcessNoise,
    measured: Measured,
    keep: bool = False,
) -> Run:
    """Run the bank over the frames, at the first of which the state is; keep: the first member's traces."""
    bank, traces = _started(state, *measured.seen.shape), []
    p, s = state.path.shape[1], state.covariance.shape[1]
    moved, seen = np.eye(p + ROTATION), np.asarray(measured.seen.any(axis=1))
    with np.errstate(over="ignore", invalid="ignore"):  # of members that go astray
        for frame in frames:
            if frame > frames.start:
                dt = float(time[frame] - time[frame - 1])
                bank.state, moved = _predicted(bank.state, frame - 1, dt, process, noise)
            trace = None
            if keep:
                trace = Trace(moved, bank.state.covariance[0, :p], np.eye(s), np.zeros((s, s)), np.zeros(s))
            if seen[frame]:
                trace = _told(bank, frame, process, measured, trace)
                _drop_astray(bank)
            if trace is not None:
                traces.append(trace)
            if not np.isfinite(bank.log_likelihood).any():
                break
    return Run(
        bank.state,
        bank.log_likelihood,
        bank.squares,
        bank.predicted,
        bank.total / np.maximum(bank.values, 1.0),
        bank.restarts,
        tuple(traces),
    )


def _started(state: State, n: int, m: int) -> _Bank:
    k, p = state.path.shape
    slack = 3 * float(np.sqrt(np.einsum("kii->ki", state.covariance)[:, p + 3 : p + 6].max()))
    return _Bank(
        state=state,
        log_likelihood=np.zeros(k),
        squares=np.full((k, n, m), np.nan),
        predicted=np.full((k, n, m, 3), np.nan),
        total=np.zeros(k),
        values=np.zeros(k),
        restarts=np.zeros(k, dtype=np.intp),
        known=np.zeros((k, m), dtype=bool),
        missed=np.zeros((k, m), dtype=np.intp),
        pace=float(np.linalg.norm(state.rate, axis=1).max()) + slack,
    )


def _told(bank: _Bank, frame: int, process: PathProcess, measured: Measured, trace: Trace | None) -> Trace | None:
    """What a frame's observations tell the bank: an update by the features known, and places for those that are not."""
    seen, sure = measured.seen[frame], _sure(bank.state)
    old = np.nonzero(seen & bank.known.any(axis=0))[0]
    if len(old):
        sure, trace = _updated(bank, frame, old, process, measured, sure, trace)
    fresh = seen & ((bank.missed >= RENEWED) | ~bank.known) & sure[:, None]
    if fresh.any():
        bank.state, follow = placed(bank.state, process, frame, fresh, measured)
        if trace is not None:
            trace = replace(trace, follow=follow[0] @ trace.follow)
        bank.missed[fresh] = 0
        bank.known |= fresh
    return trace


def _updated(
    bank: _Bank,
    frame: int,
    old: IntArray,
    process: PathProcess,
    measured: Measured,
    sure: BoolArray,
    trace: Trace | None,
) -> tuple[BoolArray, Trace | None]:
    """An update by c features `old`, after a restart where it takes one; and which members are sure of their attitude.

    A restart, or observations that a member cannot make use of, cost as much likelihood as if all lay on the gate.
    """
    known, pick, keep = bank.known[:, old], None, trace is not None
    used = known & sure[:, None]
    state, update = updated(bank.state, process, frame, old, measured, used, keep)
    lost = ~sure | _contradicted(update.squares, known)
    if lost.any():
        again, found, pick = restarted(bank.state, frame, old, measured, known, lost, bank.pace)
        bank.restarts, sure = bank.restarts + found, sure | found
        used = known & sure[:, None]
        state, update = updated(again, process, frame, old, measured, used, keep)
        bank.log_likelihood -= 0.5 * GATE * known.sum(axis=1) * (found | ~sure)
    bank.state = state
    bank.log_likelihood += update.log_likelihood
    bank.total, bank.values = bank.total + update.total, bank.values + update.values
    bank.squares[:, frame, old] = np.where(used, update.squares, np.nan)
    bank.predicted[:, frame, old] = np.where(used[:, :, None], update.predicted, np.nan)
    missed = bank.missed[:, old]
    bank.missed[:, old] = np.where(used, np.where(update.squares < GATE, 0, missed + 1), missed)
    if trace is not None:
        trace = replace(trace, follow=update.follow, information=update.information, rhs=update.rhs)
        trace = trace if pick is None else trace.after(pick)
    return sure, trace


def _sure(state: State) -> BoolArray:
    """Members (k,) whose attitude is known well enough to predict what is seen."""
    p = state.path.shape[1]
    return np.asarray((np.einsum("kii->ki", state.covariance)[:, p : p + 3] < UNSURE**2).all(axis=1))


def _contradicted(squares: FloatArray, told: BoolArray) -> BoolArray:
    """Members (k,) for which of three observations (k, c) or more, too many to be wrong, most lie beyond the gate."""
    wrong, count = ((squares >= GATE) & told).sum(axis=1), told.sum(axis=1)
    return np.asarray((count >= LEAST) & (2 * wrong > count))


def _drop_astray(bank: _Bank) -> None:
    """Members that have gone astray go on as copies of one that has not, their log-likelihood −∞ from now on."""
    state = bank.state
    sound = (state.inertia.trace(axis1=1, axis2=2) < LONGEST) & np.isfinite(state.path).all(axis=1)
    sound &= np.isfinite(bank.log_likelihood) & (np.abs(state.rate).max(axis=1) < FASTEST * bank.pace)
    bank.log_likelihood[~sound] = -np.inf
    if not sound.all() and sound.any():
        order = np.where(sound, np.arange(len(sound)), np.argmax(sound))
        bank.state, bank.known, bank.missed = state.where(order), bank.known[order], bank.missed[order]


def _predicted(
    state: State, step: int, dt: float, process: PathProcess, noise: ProcessNoise
) -> tuple[State, FloatArray]:
    """One frame on, dt in s; and how the errors of path and rotation of the first member moved."""
    p, q = state.path.shape[1], state.path.shape[1] + ROTATION
    transition = process.transition[step]
    quaternion, rate, change = rotated(state.quaternion, state.rate, state.inertia, noise.gravity_gradient[:, step], dt)
    follow = np.zeros((len(rate), q, q))
    follow[:, :p, :p] = transition
    follow[:, p:, p:] = change
    P = state.covariance.copy()
    P[:, :q] = follow @ P[:, :q]
    P[:, :, :q] = P[:, :, :q] @ follow.transpose(0, 2, 1)
    P[:, :p, :p] += noise.path[:, None, None] * noise.unit[noise.which, step]
    turning = [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]
    for i in range(2):
        for j in range(2):
            block = P[:, p + 3 * i : p + 3 * i + 3, p + 3 * j : p + 3 * j + 3]
            np.einsum("kii->ki", block)[:] += (noise.turn * turning[i][j])[:, None]
    moved = replace(state, path=state.path @ transition.T, quaternion=quaternion, rate=rate, covariance=P)
    return moved, follow[0]
