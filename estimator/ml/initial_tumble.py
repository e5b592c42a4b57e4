"""Initial rotation of the target from the attitudes of its bodies: rate and inertia, fitted to all frames.

The angular momentum R J ω of a free body is constant. With rates from short windows of the attitudes, this is linear in
J and the momentum, and determines both up to a factor. From there the motion is fitted to the attitudes by damped
Gauss–Newton steps, first over the window that it predicts to within a radian, then over longer and longer ones. The fit
also gives the relative attitude of bodies that share too few features for a registration.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import FrameShifts, shifts_in
from baryscope.estimator.adjustment.normal_equations import attitude_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.inertia import INERTIA_DEVIATION, Excess, of_a_body
from baryscope.estimator.dynamics.rotation import INERTIA, RATE_AND_INERTIA, Rotation, too_long
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.ml.nutation import near_spins
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.noise import MEDIAN
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

WINDOWS = 150  # of frames from which rates are computed
WINDOW_ANGLE = 0.8  # rad that the body turns in a window
EPOCHS = (0.5, 0.3, 0.7)  # shares of the time span at which the fit is started until one explains the attitudes
EXPLAINED = 4.0  # median of the squares over that of noise alone, below which the attitudes are explained
AT_NOISE, CLEAR = 1.5, 5.0  # that median, and a nutation's width in an attitude's deviations, which leave no doubt
OUTLIER_RATIO = 3.0  # residual of a window over the median, above which it is an outlier
MAX_HALF_WIDTH = 40  # frames of a window on either side
# Bound of the integration's nodes, two per radian: more would take many minutes for a fit.
MAX_NODES, NODES_PER_FRAME = 5000, 10
NODE_ANGLE = 0.7  # rad from node to node: an error of 2e-5 rad after 600 rotations
MAX_POSES = 1500  # attitudes that the motion is fitted to
PREDICTED = 0.7  # rad within which attitudes count as predicted
WINDOW_GROWTH = 3.0  # factor of the fitted window from one fit to the next
MAX_STEPS = 12  # of one fit
DAMPING = 1e-6  # of the first step of a fit, over the diagonal
# Relative decrease of the cost that a step must predict, while the window grows and at the end.
ROUGH_TOLERANCE, FINE_TOLERANCE = 0.1, 1e-3


@dataclass(frozen=True, eq=False)
class Tumble:
    """The rotation of axes B, and the orientation R_B_S (3, 3) of each body's axes in them.

    cost: the robust cost of the attitudes, in variances; median_ratio: the median of their squares over its expectation
    for noise alone; information (8, 8) on rate and inertia for unknown orientations of the bodies.
    """

    rotation: Rotation
    bodies: tuple[FloatArray, ...]
    cost: float
    median_ratio: float
    information: FloatArray = field(default_factory=lambda: np.zeros((RATE_AND_INERTIA, RATE_AND_INERTIA)))

    @property
    def excess(self) -> float:
        """−2 ln p of this model of the rotation, up to a constant, over all rates and inertias (Laplace).

        A model that tells the inertia better has to: of two that fit alike, more motions of the other one do.
        """
        if self.cost == np.inf:
            return np.inf
        sphere = self.rotation.inertia - np.eye(3) / 3
        posterior = self.information + np.diag([0.0, 0.0, 0.0, *5 * [INERTIA_DEVIATION**-2]])
        return self.cost + float(np.sum(sphere**2)) / INERTIA_DEVIATION**2 + float(np.linalg.slogdet(posterior)[1])


@dataclass(frozen=True, eq=False)
class _Poses:
    """Attitudes R_C_S (n, 3, 3) at time (n,) in s, the index of their body (n,), and information (n, 3, 3), 1/rad²."""

    time: FloatArray
    attitude: FloatArray
    body: IntArray
    information: FloatArray

    def where(self, index: NDArray[np.bool_] | IntArray) -> "_Poses":
        return _Poses(self.time[index], self.attitude[index], self.body[index], self.information[index])


def fit_tumbles(
    bodies: tuple[Body, ...],
    observations: Observations,
    variance: float,
    time: FloatArray,
    orbits: tuple[Orbit | None, ...],
    shifts: FrameShifts | None = None,
) -> tuple[Tumble, ...]:
    """The rotations that fit the attitudes of the bodies best for the gravity gradients of `orbits`, likeliest first.

    variance: of an observation of weight 1; time (n,) of all frames in s; shifts: of these.

    Raises:
        ComputationError: no window of frames determines a rate.
    """
    poses = _poses(bodies, observations, variance, time, shifts)
    main = int(np.argmax(np.bincount(poses.body, minlength=len(bodies))))
    best: Tumble | None = None
    fast: list[float] = []
    for guess in _guesses(bodies[main], time):
        start = replace(guess, orbit=orbits[0])
        if not start.reaches(time, MAX_NODES + NODES_PER_FRAME * len(time)):
            fast.append(float(np.linalg.norm(start.rate)))
            continue
        fitted = _fitted_over_growing_windows(start, poses, main, len(bodies))
        if best is None or fitted.cost < best.cost:
            best = fitted
        if best.median_ratio < EXPLAINED:
            break
    if best is None and fast:
        raise too_long(min(fast), float(time[-1] - time[0]))
    if best is not None and best.cost == np.inf:
        raise ComputationError("no free rotation follows the attitudes over the whole time", Reason.DIVERGED)
    if best is None:
        raise ComputationError(
            "no stretch of frames shows how fast the target turns: features are not followed for long enough",
            Reason.SHORT_INTERVALS,
        )
    fits = [_of_near_spin(best, bodies[main], poses, main, time)]
    for orbit in orbits[1:]:
        fits.append(_fitted(replace(best, rotation=replace(best.rotation, orbit=orbit)), poses, FINE_TOLERANCE))
    return tuple(sorted(fits, key=lambda fit: fit.excess))


def _of_near_spin(best: Tumble, body: Body, poses: _Poses, main: int, time: FloatArray) -> Tumble:
    """The fit, or a better one from the nutation that the attitudes of a body show where they are near a spin.

    A fit of another frequency or sense would be off by the nutation's width in most frames: where that is clear in each
    of them, one that leaves no more than noise is the best.
    """
    at = time[body.frames]
    k = int(np.argmin(np.abs(at - best.rotation.epoch)))
    certainty = float(np.median(np.linalg.eigvalsh(poses.information[poses.body == main])[:, 0]))
    for near in near_spins(at, body.attitude, best.rotation.rate):
        if best.median_ratio < AT_NOISE and near.width**2 * certainty > CLEAR**2:
            break
        state = {"epoch": float(at[k]), "attitude": body.attitude[k], "rate": near.rate[k], "inertia": near.inertia}
        other = _fitted_over_growing_windows(replace(best.rotation, **state), poses, main, len(best.bodies))
        best = min(best, other, key=lambda fit: fit.cost)
    return best


def _poses(
    bodies: tuple[Body, ...],
    observations: Observations,
    variance: float,
    time: FloatArray,
    shifts: FrameShifts | None,
) -> _Poses:
    """A subsample of the attitudes of all bodies, ordered in time, with their information."""
    total = sum(len(body.frames) for body in bodies)
    every = max(1, total // MAX_POSES)
    parts = []
    for index, body in enumerate(bodies):
        frames, attitude = body.frames[::every], body.attitude[::every]
        own = observations.features(body.features).frames(frames)
        information = attitude_information(own, attitude, body.points, shifts_in(shifts, frames))
        parts.append((time[frames], attitude, np.full(len(frames), index), information / variance))
    order = np.argsort(np.concatenate([part[0] for part in parts]), kind="stable")
    columns = [np.concatenate(values)[order] for values in zip(*parts, strict=True)]
    return _Poses(*columns)


def _guesses(body: Body, time: FloatArray) -> Iterator[Rotation]:
    """Initial rotations in the body's axes at frames near the EPOCHS, with the estimated inertia, then a sphere's.

    If the axis of rotation hardly moves, the estimated inertia can be worse than a sphere's.
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
    """Rates (k, 3) in S, rad/s, at some of the body's frames (k,), from cubics fitted to short windows of attitudes.

    Windows with large residuals are left out, as they contain wrong attitudes.
    """
    n = len(body.frames)
    at = time[body.frames]
    steps = log_rotation(np.swapaxes(body.attitude[:-1], 1, 2) @ body.attitude[1:])
    speed = float(np.median(np.linalg.norm(steps, axis=1) / np.diff(at))) if n > 1 else 0.0
    interval = float(np.median(np.diff(at))) if n > 1 else 1.0
    half = int(np.clip(round(WINDOW_ANGLE / max(speed * interval, 1e-9) / 2), 2, MAX_HALF_WIDTH))
    centres = np.unique(np.linspace(half, n - 1 - half, WINDOWS).astype(np.intp)) if n > 2 * half else np.empty(0, int)
    rows = centres[:, None] + np.arange(-half, half + 1)
    span = at[rows] - at[centres][:, None]
    # No window across a gap.
    gapless = (span[:, -1] - span[:, 0]) < 2 * interval * 2 * half if len(rows) else np.zeros(0, dtype=bool)
    centres, rows, span = centres[gapless], rows[gapless], span[gapless]
    if not len(rows):
        return centres, np.empty((0, 3))
    relative = np.swapaxes(body.attitude[centres], 1, 2)[:, None] @ body.attitude[rows]
    turns = log_rotation(relative.reshape(-1, 3, 3)).reshape(len(rows), -1, 3)
    scale = np.abs(span).max(axis=1)[:, None]
    powers = (span / scale)[:, :, None] ** np.arange(4 if half > 2 else 3)
    fitted = np.linalg.pinv(powers) @ turns
    residual = np.linalg.norm(turns - powers @ fitted, axis=2).max(axis=1)
    inlier = residual <= OUTLIER_RATIO * np.median(residual)
    return centres[inlier], (fitted[:, 1] / scale)[inlier]


def _inertia(attitude: FloatArray, rates: FloatArray) -> FloatArray:
    """J of trace 1 from R J ω = h by the smallest singular vector; a sphere's if that is not positive definite."""
    speed = float(np.sqrt(np.mean(rates**2))) or 1.0
    x, y, z = (rates / speed).T
    zero = np.zeros_like(x)
    by_inertia = np.stack(
        [
            np.stack([x, zero, zero, y, z, zero], axis=1),
            np.stack([zero, y, zero, x, zero, z], axis=1),
            np.stack([zero, zero, z, zero, x, y], axis=1),
        ],
        axis=1,
    )
    rows = np.concatenate([attitude @ by_inertia, np.tile(-np.eye(3), (len(x), 1, 1))], axis=2)
    vector = np.linalg.svd(rows.reshape(-1, 9), full_matrices=False)[2][-1]
    for _ in range(3):
        residual = np.linalg.norm(rows @ vector, axis=1)
        inlier = residual <= OUTLIER_RATIO * np.median(residual)
        vector = np.linalg.svd(rows[inlier].reshape(-1, 9), full_matrices=False)[2][-1]
    xx, yy, zz, xy, xz, yz = vector[:6]
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J *= np.sign(np.trace(J)) or 1.0
    values, vectors = np.linalg.eigh(J)
    if values[0] <= 0.02 * values[-1]:
        return np.eye(3) / 3
    return of_a_body((vectors * values) @ vectors.T)


def _fitted_over_growing_windows(start: Rotation, poses: _Poses, main: int, count: int) -> Tumble:
    """The fit to all poses, from an initial rotation that may predict only a short window around its epoch."""
    tumble = Tumble(start, tuple(np.eye(3) for _ in range(count)), np.inf, np.inf)
    present_bodies = {main}
    distance = np.abs(poses.time - start.epoch)
    longest = float(distance.max())
    own = poses.body == main
    found = _residuals(tumble, poses.where(own))
    if found is None:
        return tumble
    residual = np.linalg.norm(found[0], axis=1)
    window = longest
    if residual.max() > PREDICTED:
        window = float(distance[own][residual > PREDICTED].min())
    window = max(window, float(np.sort(distance[own])[min(8, own.sum() - 1)]))
    while True:
        near = distance <= window * (1 + 1e-9)
        for body in sorted(set(np.unique(poses.body[near]).tolist()) - present_bodies):
            tumble = _with_body(tumble, poses.where(near & (poses.body == body)), body)
            present_bodies.add(body)
        tumble = _fitted(tumble, poses.where(near), FINE_TOLERANCE if window >= longest else ROUGH_TOLERANCE)
        if window >= longest or tumble.cost == np.inf:
            return tumble
        window = min(WINDOW_GROWTH * window, longest)


def _with_body(tumble: Tumble, poses: _Poses, body: int) -> Tumble:
    """The fit with the orientation of another body: its mean attitude relative to the motion, near the epoch."""
    nearest = np.argsort(np.abs(poses.time - tumble.rotation.epoch))[:20]
    few = poses.where(nearest)
    R_B_C = np.swapaxes(tumble.rotation.at(few.time).attitude, 1, 2)
    u, _, vt = np.linalg.svd((R_B_C @ few.attitude).mean(axis=0))
    R_B_S = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return replace(tumble, bodies=tuple(R_B_S if k == body else R for k, R in enumerate(tumble.bodies)))


def _residuals(tumble: Tumble, poses: _Poses) -> tuple[FloatArray, FloatArray] | None:
    """Rotation vectors (n, 3) in S, rad, from predicted to observed attitudes; Jacobian (n, 3, 8) of the latter.

    None where the rotation is not possible, or cannot be integrated.
    """
    found = tumble.rotation.try_at(poses.time, NODE_ANGLE) if tumble.rotation.possible else None
    if found is None:
        return None
    R_B_S = np.array(tumble.bodies)[poses.body]
    residual = log_rotation(np.swapaxes(found.attitude @ R_B_S, 1, 2) @ poses.attitude)
    return residual, np.swapaxes(R_B_S, 1, 2) @ found.turn


def _fitted(tumble: Tumble, poses: _Poses, tolerance: float) -> Tumble:
    """Damped Gauss–Newton steps in rate, inertia and the bodies' orientations.

    They end when a step predicts a relative decrease of the cost of at most `tolerance`.
    """
    present = np.unique(poses.body)
    size = RATE_AND_INERTIA + 3 * len(present)
    slot = np.searchsorted(present, poses.body)
    damping = DAMPING
    found = _residuals(tumble, poses)
    if found is None:
        return replace(tumble, cost=np.inf, median_ratio=np.inf)
    residual, turn = found
    cost = _cost(tumble, residual, poses)
    for _ in range(MAX_STEPS):
        weight = _robust_weight(residual, poses)
        information = weight[:, None, None] * poses.information
        jacobian = np.zeros((len(poses.time), 3, size))
        jacobian[:, :, :RATE_AND_INERTIA] = turn
        for axis in range(3):
            jacobian[np.arange(len(slot)), axis, RATE_AND_INERTIA + 3 * slot + axis] = 1.0
        weighted = information @ jacobian
        matrix = jacobian.reshape(-1, size).T @ weighted.reshape(-1, size)
        rhs = np.einsum("nip,ni->p", weighted, residual)
        excess = Excess.of(tumble.rotation.inertia)
        matrix[INERTIA, INERTIA] += excess.information
        rhs[INERTIA] -= excess.pull
        while damping < 1e8:
            change = symmetric_pseudo_inverse(matrix + damping * np.diag(np.diag(matrix))) @ rhs
            if change @ rhs <= tolerance * cost:
                return replace(
                    tumble, cost=cost, median_ratio=_median_ratio(residual, poses), information=_reduced(matrix)
                )
            trial = _changed(tumble, change, present)
            found = _residuals(trial, poses)
            if found is not None:
                trial_residual, trial_turn = found
                trial_cost = _cost(trial, trial_residual, poses)
                if trial_cost <= cost:
                    tumble, residual, turn, cost = trial, trial_residual, trial_turn, trial_cost
                    damping /= 30
                    break
            damping *= 10
    return replace(tumble, cost=cost, median_ratio=_median_ratio(residual, poses), information=_reduced(matrix))


def _reduced(matrix: FloatArray) -> FloatArray:
    """The information (8, 8) on rate and inertia in that on all unknowns, which end with the bodies' orientations."""
    own, others = slice(0, RATE_AND_INERTIA), slice(RATE_AND_INERTIA, None)
    inverse = symmetric_pseudo_inverse(matrix[others, others])
    return np.asarray(matrix[own, own] - matrix[own, others] @ inverse @ matrix[others, own])


def _changed(tumble: Tumble, change: FloatArray, present: IntArray) -> Tumble:
    turns = change[RATE_AND_INERTIA:].reshape(-1, 3)
    bodies = list(tumble.bodies)
    for body, turn in zip(present.tolist(), turns, strict=True):
        bodies[body] = bodies[body] @ exp_rotation(turn)
    rotation = tumble.rotation.changed(np.zeros(3), change[:RATE_AND_INERTIA])
    return replace(tumble, rotation=rotation, bodies=tuple(bodies))


def _squares(residual: FloatArray, poses: _Poses) -> FloatArray:
    return np.asarray(np.einsum("ni,nij,nj->n", residual, poses.information, residual))


def _median_ratio(residual: FloatArray, poses: _Poses) -> float:
    return float(np.median(_squares(residual, poses))) / MEDIAN


def _cost(tumble: Tumble, residual: FloatArray, poses: _Poses) -> float:
    """Cauchy's robust cost, in variances, which limits the influence of wrong poses, and that of an inertia that is no
    body's.
    """
    scale = 9 * 3.0
    return float(scale * np.log1p(_squares(residual, poses) / scale).sum()) + Excess.of(tumble.rotation.inertia).cost


def _robust_weight(residual: FloatArray, poses: _Poses) -> FloatArray:
    return np.asarray(1 / (1 + _squares(residual, poses) / (9 * 3.0)))
