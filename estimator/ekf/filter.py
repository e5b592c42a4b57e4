"""The filter of `ekf`: a bank of iterated extended Kalman filters, run together over one target's observations."""

from dataclasses import dataclass, replace

import numpy as np

from baryscope.estimator.adjustment.reweighting import GATE
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, rotated
from baryscope.estimator.ekf.restart import restarted
from baryscope.estimator.ekf.state import Measured, State
from baryscope.estimator.ekf.update import placed, updated
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

MAX_CONSECUTIVE_OUTLIERS = 8  # of a feature, after which its point is initialised again
MAX_ATTITUDE_DEVIATION = 1.0  # rad, standard deviation above which the attitude cannot be used for a prediction
MIN_OBSERVATIONS = 3  # that determine an attitude
MAX_INERTIA_TRACE = 100.0  # initially 1, with the determinant kept: beyond any body except in the first iterations
MAX_RATE_RATIO = 10.0  # bound of the rate over its initial upper bound


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """Process noise of k members.

    unit (o, n - 1, p, p): covariances of the path's steps for 1 m after the time span, for each order; which (k,): the
    index of each member's order; path (k,): factor on it; turn (k,): spectral density of the angular acceleration,
    rad²/s³; gravity_gradient (k, n - 1, 3): see `motion.rotated`.
    """

    unit: FloatArray
    which: IntArray
    path: FloatArray
    turn: FloatArray
    gravity_gradient: FloatArray

    def of_path(self, member: int) -> FloatArray:
        """The covariance (n - 1, p, p) of the process noise of a member's path, per step."""
        return np.asarray(self.path[member] * self.unit[self.which[member]])


@dataclass(frozen=True, eq=False)
class Trace:
    """A filter step as the smoother needs it.

    moved (p + 11, p + 11): transition of the errors of path and rotation to this frame; covariance (p, s): of the
    path's errors with all errors, before the update; follow (s, s): transition of the errors by the update; information
    (s, s) and rhs (s,) of the frame's observations.
    """

    moved: FloatArray
    covariance: FloatArray
    follow: FloatArray
    information: FloatArray
    rhs: FloatArray

    def after(self, pick: FloatArray) -> "Trace":
        """The step with a transition pick (s, s) of the errors before the update."""
        return replace(
            self,
            follow=self.follow @ pick,
            information=pick.T @ self.information @ pick,
            rhs=pick.T @ self.rhs,
        )


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a pass of k members.

    state at the last frame; log_likelihood (k,) of the innovations, −∞ for diverged members; squares (k, n, m):
    normalised squared innovation of each observation, NaN if there is none; predicted (k, n, m, 3): predicted
    positions in C, m; nis (k,): mean normalised innovation squared of the accepted values, 1 is expected; restarts
    (k,): number of registrations of a attitude_lost attitude; traces of the first member, if they are kept.
    """

    state: State
    log_likelihood: FloatArray
    squares: FloatArray
    predicted: FloatArray
    nis: FloatArray
    restarts: IntArray
    traces: tuple[Trace, ...]

    @property
    def accepted(self) -> FloatArray:
        """Normalised squared innovations of the first member's observations that lie within the gate, (j,)."""
        squares = self.squares[0]
        return np.asarray(squares[(squares >= 0) & (squares < GATE)])

    def only(self, member: int) -> "Run":
        """The result of one member."""
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
    """A bank of k members during a pass: its state, the results so far, see `Run`, and the initialised features (k, m).

    outliers (k, m): consecutive observations beyond the gate; max_rate: initial upper bound of the rate, rad/s.
    """

    state: State
    log_likelihood: FloatArray
    squares: FloatArray
    predicted: FloatArray
    total: FloatArray
    values: FloatArray
    restarts: IntArray
    known: BoolArray
    outliers: IntArray
    max_rate: float


def run_filter(
    state: State,
    frames: range,
    time: FloatArray,
    process: PathProcess,
    noise: ProcessNoise,
    measured: Measured,
    keep: bool = False,
) -> Run:
    """Run the bank over the frames; state: at the first of them; keep: whether to keep the first member's traces."""
    bank, traces = _initial_bank(state, *measured.seen.shape), []
    p, s = state.path.shape[1], state.covariance.shape[1]
    moved, seen = np.eye(p + ROTATION), np.asarray(measured.seen.any(axis=1))
    with np.errstate(over="ignore", invalid="ignore"):  # of diverging members
        for frame in frames:
            if frame > frames.start:
                dt = float(time[frame] - time[frame - 1])
                bank.state, moved = _predicted(bank.state, frame - 1, dt, process, noise)
            trace = None
            if keep:
                trace = Trace(moved, bank.state.covariance[0, :p], np.eye(s), np.zeros((s, s)), np.zeros(s))
            if seen[frame]:
                trace = _with_observations(bank, frame, process, measured, trace)
                _replace_diverged(bank)
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


def _initial_bank(state: State, n: int, m: int) -> _Bank:
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
        outliers=np.zeros((k, m), dtype=np.intp),
        max_rate=float(np.linalg.norm(state.rate, axis=1).max()) + slack,
    )


def _with_observations(
    bank: _Bank, frame: int, process: PathProcess, measured: Measured, trace: Trace | None
) -> Trace | None:
    """Update the bank by a frame's observations of known features, and initialise the points of new ones."""
    seen, has_attitude = measured.seen[frame], _has_attitude(bank.state)
    old = np.nonzero(seen & bank.known.any(axis=0))[0]
    if len(old):
        has_attitude, trace = _updated(bank, frame, old, process, measured, has_attitude, trace)
    new = seen & ((bank.outliers >= MAX_CONSECUTIVE_OUTLIERS) | ~bank.known) & has_attitude[:, None]
    if new.any():
        bank.state, follow = placed(bank.state, process, frame, new, measured)
        if trace is not None:
            trace = replace(trace, follow=follow[0] @ trace.follow)
        bank.outliers[new] = 0
        bank.known |= new
    return trace


def _updated(
    bank: _Bank,
    frame: int,
    old: IntArray,
    process: PathProcess,
    measured: Measured,
    has_attitude: BoolArray,
    trace: Trace | None,
) -> tuple[BoolArray, Trace | None]:
    """Update the bank by c known features, after a restart of members that attitude_lost the attitude.

    Returns the members (k,) with a usable attitude, and the trace. A restart, or observations without a usable
    attitude, reduce the log-likelihood as if all observations were at the gate.
    """
    known, pick, keep = bank.known[:, old], None, trace is not None
    used = known & has_attitude[:, None]
    state, update = updated(bank.state, process, frame, old, measured, used, keep)
    attitude_lost = ~has_attitude | _contradicted(update.squares, known)
    if attitude_lost.any():
        restart, registered, pick = restarted(bank.state, frame, old, measured, known, attitude_lost, bank.max_rate)
        bank.restarts, has_attitude = bank.restarts + registered, has_attitude | registered
        used = known & has_attitude[:, None]
        state, update = updated(restart, process, frame, old, measured, used, keep)
        bank.log_likelihood -= 0.5 * GATE * known.sum(axis=1) * (registered | ~has_attitude)
    bank.state = state
    bank.log_likelihood += update.log_likelihood
    bank.total, bank.values = bank.total + update.total, bank.values + update.values
    bank.squares[:, frame, old] = np.where(used, update.squares, np.nan)
    bank.predicted[:, frame, old] = np.where(used[:, :, None], update.predicted, np.nan)
    outliers = bank.outliers[:, old]
    bank.outliers[:, old] = np.where(used, np.where(update.squares < GATE, 0, outliers + 1), outliers)
    if trace is not None:
        trace = replace(trace, follow=update.follow, information=update.information, rhs=update.rhs)
        trace = trace if pick is None else trace.after(pick)
    return has_attitude, trace


def _has_attitude(state: State) -> BoolArray:
    """Members (k,) whose attitude is accurate enough for a prediction."""
    p = state.path.shape[1]
    return np.asarray((np.einsum("kii->ki", state.covariance)[:, p : p + 3] < MAX_ATTITUDE_DEVIATION**2).all(axis=1))


def _contradicted(squares: FloatArray, known: BoolArray) -> BoolArray:
    """Members (k,) for which most of at least MIN_OBSERVATIONS known observations (k, c) lie beyond the gate."""
    wrong, count = ((squares >= GATE) & known).sum(axis=1), known.sum(axis=1)
    return np.asarray((count >= MIN_OBSERVATIONS) & (2 * wrong > count))


def _replace_diverged(bank: _Bank) -> None:
    """Replace diverged members by copies of a regular one, with the log-likelihood −∞ from then on."""
    state = bank.state
    regular = (state.inertia.trace(axis1=1, axis2=2) < MAX_INERTIA_TRACE) & np.isfinite(state.path).all(axis=1)
    regular &= (np.einsum("kii->ki", state.covariance) >= 0).all(axis=1)  # or it is lost in rounding
    regular &= np.isfinite(bank.log_likelihood) & (np.abs(state.rate).max(axis=1) < MAX_RATE_RATIO * bank.max_rate)
    bank.log_likelihood[~regular] = -np.inf
    if not regular.all() and regular.any():
        order = np.where(regular, np.arange(len(regular)), np.argmax(regular))
        bank.state, bank.known, bank.outliers = state.where(order), bank.known[order], bank.outliers[order]


def _predicted(
    state: State, step: int, dt: float, process: PathProcess, noise: ProcessNoise
) -> tuple[State, FloatArray]:
    """The state at the next frame, after dt in s, and the transition of the first member's path and rotation errors."""
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
