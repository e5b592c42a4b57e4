"""How the target tumbles, from the attitudes of its bodies: a first rate and inertia, and their fit over all frames.

The angular momentum R J ω of a free body stands still: with rates from short stretches of the attitudes, that is
linear in J and the momentum, and gives both up to a factor. From there the motion is fitted to the attitudes by damped
Gauss–Newton steps, first over the stretch that it predicts to within a radian, then over ever longer ones. Bodies
that share too few features to be one get their relative attitude here, through the motion.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import attitude_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.adjustment.reweighting import MEDIAN
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, Rotation, too_long
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.registration.body import Body
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

CENTRES = 150  # stretches that rates are taken from
SWEEP = 0.8  # rad that the body turns in a stretch
EPOCHS = (0.5, 0.3, 0.7)  # shares of the time at which the motion is started from, until one explains the attitudes
EXPLAINED = 4.0  # median of the squares over that of noise alone, below which the attitudes count as explained
STRAY = 3.0  # times the median that a stretch may miss by
WIDEST = 40  # frames of a stretch at most, on either side
# Nodes of an integration, two a radian: more than these, and that many a frame, and a fit would take many minutes.
BRIDGED, PER_FRAME = 5000, 10
MOST = 1500  # attitudes that the motion is fitted to
PREDICTED = 0.7  # rad within which attitudes count as predicted
GROWTH = 3.0  # of the stretch that is fitted, from one fit to the next
STEPS = 12  # of one fit
ROUGH, FINE = 0.1, 1e-3  # share of the cost that a step must promise, while the stretch grows and at the end


@dataclass(frozen=True, eq=False)
class Tumble:
    """The motion of axes B, and each body's axes in them: R_B_S (3, 3).

    cost: the robust cost of the attitudes, in variances; usual: the median of their squares, over what noise makes it.
    """

    rotation: Rotation
    bodies: tuple[FloatArray, ...]
    cost: float
    usual: float


@dataclass(frozen=True, eq=False)
class _Poses:
    """Attitudes R_C_S (n, 3, 3) at time (n,), the body each is of, and their information (n, 3, 3) in S, 1/rad²."""

    time: FloatArray
    attitude: FloatArray
    body: IntArray
    information: FloatArray

    def where(self, index: NDArray[np.bool_] | IntArray) -> "_Poses":
        return _Poses(self.time[index], self.attitude[index], self.body[index], self.information[index])


def fit_tumble(
    bodies: tuple[Body, ...],
    observations: Observations,
    variance: float,
    time: FloatArray,
    orbits: tuple[Orbit | None, ...],
) -> Tumble:
    """The motion that explains the bodies' attitudes best, among those under the gravity gradients of `orbits`.

    Raises:
        ComputationError: the attitudes do not follow any free motion that was found.
    """
    poses = _poses(bodies, observations, variance, time)
    main = int(np.argmax(np.bincount(poses.body, minlength=len(bodies))))
    best: Tumble | None = None
    fast: list[float] = []
    for guess in _guesses(bodies[main], time):
        start = replace(guess, orbit=orbits[0])
        if not start.reaches(time, BRIDGED + PER_FRAME * len(time)):
            fast.append(float(np.linalg.norm(start.rate)))
            continue
        grown = _grown(start, poses, main, len(bodies))
        if best is None or grown.cost < best.cost:
            best = grown
        if best.usual < EXPLAINED:
            break
    if best is None and fast:
        raise too_long(min(fast), float(time[-1] - time[0]))
    if best is None:
        raise ComputationError(
            "no stretch of frames shows how fast the target turns: features are not followed for long enough",
            Reason.SHORT_INTERVALS,
        )
    fits = [best]
    for orbit in orbits[1:]:
        fits.append(_fitted(replace(best, rotation=replace(best.rotation, orbit=orbit)), poses, FINE))
    return min(fits, key=lambda fit: fit.cost)


def _poses(bodies: tuple[Body, ...], observations: Observations, variance: float, time: FloatArray) -> _Poses:
    """The attitudes of all bodies, thinned, with what the observations say of each."""
    total = sum(len(body.frames) for body in bodies)
    every = max(1, total // MOST)
    parts = []
    for index, body in enumerate(bodies):
        frames, attitude = body.frames[::every], body.attitude[::every]
        own = observations.features(body.features).frames(frames)
        information = attitude_information(own, attitude, body.points)
        parts.append((time[frames], attitude, np.full(len(frames), index), information / variance))
    order = np.argsort(np.concatenate([part[0] for part in parts]), kind="stable")
    columns = [np.concatenate(values)[order] for values in zip(*parts, strict=True)]
    return _Poses(*columns)


def _guesses(body: Body, time: FloatArray) -> Iterator[Rotation]:
    """Attitude, rate and inertia in the body's axes at a posed frame: near the middle of the time, then elsewhere.

    The last ones have a sphere's inertia, which is less wrong than one that came out of too little wobble.
    """
    centres, rates = _local_rates(body, time)
    if not len(centres):
        return
    at = time[body.frames[centres]]
    inertia = _inertia(body.attitude[centres], rates)
    for J in (inertia, np.eye(3) / 3):
        for share in EPOCHS:
            k = int(np.argmin(np.abs(at - (time[0] + share * (time[-1] - time[0])))))
            yield Rotation(float(at[k]), body.attitude[centres[k]], rates[k], J)


def _local_rates(body: Body, time: FloatArray) -> tuple[IntArray, FloatArray]:
    """Rates (k, 3) in S at some of the body's frames (k,), from cubics through the turns of a short stretch around.

    Stretches that a cubic fits much worse than most are left out: attitudes that are wrong altogether are in them.
    """
    n = len(body.frames)
    at = time[body.frames]
    steps = log_rotation(np.swapaxes(body.attitude[:-1], 1, 2) @ body.attitude[1:])
    pace = float(np.median(np.linalg.norm(steps, axis=1) / np.diff(at))) if n > 1 else 0.0
    usual = float(np.median(np.diff(at))) if n > 1 else 1.0
    half = int(np.clip(round(SWEEP / max(pace * usual, 1e-9) / 2), 2, WIDEST))
    centres = np.unique(np.linspace(half, n - 1 - half, CENTRES).astype(np.intp)) if n > 2 * half else np.empty(0, int)
    rows = centres[:, None] + np.arange(-half, half + 1)
    span = at[rows] - at[centres][:, None]
    # No stretch across a gap.
    whole = (span[:, -1] - span[:, 0]) < 2 * usual * 2 * half if len(rows) else np.zeros(0, dtype=bool)
    centres, rows, span = centres[whole], rows[whole], span[whole]
    if not len(rows):
        return centres, np.empty((0, 3))
    relative = np.swapaxes(body.attitude[centres], 1, 2)[:, None] @ body.attitude[rows]
    turns = log_rotation(relative.reshape(-1, 3, 3)).reshape(len(rows), -1, 3)
    scale = np.abs(span).max(axis=1)[:, None]
    powers = (span / scale)[:, :, None] ** np.arange(4 if half > 2 else 3)
    fitted = np.linalg.pinv(powers) @ turns
    missed = np.linalg.norm(turns - powers @ fitted, axis=2).max(axis=1)
    good = missed <= STRAY * np.median(missed)
    return centres[good], (fitted[:, 1] / scale)[good]


def _inertia(attitude: FloatArray, rates: FloatArray) -> FloatArray:
    """J up to scale from R J ω = h: the smallest singular vector; a sphere's where that is not positive definite."""
    pace = float(np.sqrt(np.mean(rates**2))) or 1.0
    x, y, z = (rates / pace).T
    nought = np.zeros_like(x)
    by_inertia = np.stack(
        [
            np.stack([x, nought, nought, y, z, nought], axis=1),
            np.stack([nought, y, nought, x, nought, z], axis=1),
            np.stack([nought, nought, z, nought, x, y], axis=1),
        ],
        axis=1,
    )
    rows = np.concatenate([attitude @ by_inertia, np.tile(-np.eye(3), (len(x), 1, 1))], axis=2)
    vector = np.linalg.svd(rows.reshape(-1, 9), full_matrices=False)[2][-1]
    for _ in range(3):
        missed = np.linalg.norm(rows @ vector, axis=1)
        good = missed <= STRAY * np.median(missed)
        vector = np.linalg.svd(rows[good].reshape(-1, 9), full_matrices=False)[2][-1]
    xx, yy, zz, xy, xz, yz = vector[:6]
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J *= np.sign(np.trace(J)) or 1.0
    values, vectors = np.linalg.eigh(J)
    if values[0] <= 0.02 * values[-1]:
        return np.eye(3) / 3
    return np.asarray((vectors * values) @ vectors.T / values.sum())


def _grown(start: Rotation, poses: _Poses, main: int, count: int) -> Tumble:
    """The fit over all poses, from a guess that may hold for a short stretch around its epoch only."""
    tumble = Tumble(start, tuple(np.eye(3) for _ in range(count)), np.inf, np.inf)
    known = {main}
    distance = np.abs(poses.time - start.epoch)
    longest = float(distance.max())
    own = poses.body == main
    missed = np.linalg.norm(_misses(tumble, poses.where(own))[0], axis=1)
    reach = longest
    if missed.max() > PREDICTED:
        reach = float(distance[own][missed > PREDICTED].min())
    reach = max(reach, float(np.sort(distance[own])[min(8, own.sum() - 1)]))
    while True:
        near = distance <= reach * (1 + 1e-9)
        for body in sorted(set(np.unique(poses.body[near]).tolist()) - known):
            tumble = _joined(tumble, poses.where(near & (poses.body == body)), body)
            known.add(body)
        tumble = _fitted(tumble, poses.where(near), FINE if reach >= longest else ROUGH)
        if reach >= longest:
            return tumble
        reach = min(GROWTH * reach, longest)


def _joined(tumble: Tumble, poses: _Poses, body: int) -> Tumble:
    """With the axes of a body that was not there before: its mean attitude against the motion, near the epoch."""
    nearest = np.argsort(np.abs(poses.time - tumble.rotation.epoch))[:20]
    few = poses.where(nearest)
    R_B_C = np.swapaxes(tumble.rotation.at(few.time).attitude, 1, 2)
    u, _, vt = np.linalg.svd((R_B_C @ few.attitude).mean(axis=0))
    R_B_S = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return replace(tumble, bodies=tuple(R_B_S if k == body else R for k, R in enumerate(tumble.bodies)))


def _misses(tumble: Tumble, poses: _Poses) -> tuple[FloatArray, FloatArray]:
    """Rotation vectors (n, 3) in S from predicted to seen attitudes, and how rate and inertia turn them, (n, 3, 8)."""
    found = tumble.rotation.at(poses.time)
    R_B_S = np.array(tumble.bodies)[poses.body]
    missed = log_rotation(np.swapaxes(found.attitude @ R_B_S, 1, 2) @ poses.attitude)
    return missed, np.swapaxes(R_B_S, 1, 2) @ found.turn


def _fitted(tumble: Tumble, poses: _Poses, promise: float) -> Tumble:
    """Damped Gauss–Newton steps in rate, inertia and all bodies' axes, while one promises that share of the cost."""
    present = np.unique(poses.body)
    size = RATE_AND_INERTIA + 3 * len(present)
    slot = np.searchsorted(present, poses.body)
    damping = 1e-4
    missed, turn = _misses(tumble, poses)
    cost = _robust_cost(missed, poses)
    for _ in range(STEPS):
        weight = _robust_weight(missed, poses)
        information = weight[:, None, None] * poses.information
        jacobian = np.zeros((len(poses.time), 3, size))
        jacobian[:, :, :RATE_AND_INERTIA] = turn
        for axis in range(3):
            jacobian[np.arange(len(slot)), axis, RATE_AND_INERTIA + 3 * slot + axis] = 1.0
        weighted = information @ jacobian
        matrix = jacobian.reshape(-1, size).T @ weighted.reshape(-1, size)
        rhs = np.einsum("nip,ni->p", weighted, missed)
        while damping < 1e8:
            change = symmetric_pseudo_inverse(matrix + damping * np.diag(np.diag(matrix))) @ rhs
            if change @ rhs <= promise * cost:
                return replace(tumble, cost=cost, usual=_usual(missed, poses))
            trial = _changed(tumble, change, present)
            if trial.rotation.possible and trial.rotation.reaches(poses.time):
                trial_missed, trial_turn = _misses(trial, poses)
                trial_cost = _robust_cost(trial_missed, poses)
                if trial_cost <= cost:
                    tumble, missed, turn, cost = trial, trial_missed, trial_turn, trial_cost
                    damping /= 30
                    break
            damping *= 10
    return replace(tumble, cost=cost, usual=_usual(missed, poses))


def _changed(tumble: Tumble, change: FloatArray, present: IntArray) -> Tumble:
    turns = change[RATE_AND_INERTIA:].reshape(-1, 3)
    bodies = list(tumble.bodies)
    for body, turn in zip(present.tolist(), turns, strict=True):
        bodies[body] = bodies[body] @ exp_rotation(turn)
    rotation = tumble.rotation.changed(np.zeros(3), change[:RATE_AND_INERTIA])
    return replace(tumble, rotation=rotation, bodies=tuple(bodies))


def _squares(missed: FloatArray, poses: _Poses) -> FloatArray:
    return np.asarray(np.einsum("ni,nij,nj->n", missed, poses.information, missed))


def _usual(missed: FloatArray, poses: _Poses) -> float:
    return float(np.median(_squares(missed, poses))) / MEDIAN


def _robust_cost(missed: FloatArray, poses: _Poses) -> float:
    """Cauchy's: a pose that is wrong altogether shall not rule. In variances, about one for each value."""
    scale = 9 * 3.0
    return float(scale * np.log1p(_squares(missed, poses) / scale).sum())


def _robust_weight(missed: FloatArray, poses: _Poses) -> FloatArray:
    return np.asarray(1 / (1 + _squares(missed, poses) / (9 * 3.0)))
