"""The estimation problem of `ekf`, linearised about a reference motion.

The dynamic state at a node is s = (u, φ, ω): deviations of the path's u, m, of the attitude, a rotation vector in B,
and of the rate. Unknowns that are constant or initial values are the parameters θ = (five of the inertia, x of the
path, ω at the first node, points). Means are affine in θ: they are held as matrices whose first column is the mean for
θ = 0 and whose others are its derivatives by θ (de Jong's augmentation).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, changed_inertia, rotated
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation, log_rotation
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

INERTIA = ROTATION - 6  # unknowns of the inertia
STATE = 12  # unknowns at a node
LEAST = 1e-15  # eigenvalue of a node's information over the greatest: a smaller one is rounding
PATH, TURN, RATE = slice(0, 6), slice(6, 9), slice(9, STATE)  # of these


@dataclass(frozen=True, eq=False)
class Nodes:
    """The times (n,) of all frames and of more in long gaps, s, and the index of each frame among them."""

    time: FloatArray
    frames: IntArray

    @classmethod
    def between(cls, time: FloatArray, longest: float) -> "Nodes":
        """The frames' times (n,), with nodes between frames that are further apart than `longest` s."""
        parts = np.maximum(np.ceil(np.diff(time) / longest - 1e-9), 1.0).astype(np.intp)
        frames = np.concatenate([[0], np.cumsum(parts)]).astype(np.intp)
        which = np.repeat(np.arange(len(parts)), parts)
        share = (np.arange(int(frames[-1])) - frames[which]) / parts[which]
        inside = time[which] + share * np.diff(time)[which]
        return cls(np.append(inside, time[-1]), frames)


@dataclass(frozen=True, eq=False)
class Reference:
    """The motion about which all is linearised: at n nodes, and the points.

    path: the process, its unknowns x (s,), and deviation (n, 6): its u; attitude (n, 3, 3) R_C_B; rate (n, 3), rad/s in
    B; inertia (3, 3) of trace 1; points (m, 3), m in B; axis (n - 1, 3): of the gravity gradient in each step, see
    `motion.rotated`.
    """

    path: PathProcess
    x: FloatArray
    deviation: FloatArray
    attitude: FloatArray
    rate: FloatArray
    inertia: FloatArray
    points: FloatArray
    axis: FloatArray

    @property
    def origin(self) -> FloatArray:
        """The centre of mass in C, (n, 3), m."""
        return self.path.position(self.deviation)

    def seen_at(self, nodes: Nodes) -> FloatArray:
        """The positions (frames, m, 3) of the points in C, m."""
        at = nodes.frames
        return np.asarray(self.points @ np.swapaxes(self.attitude[at], 1, 2) + self.origin[at][:, None])


@dataclass(frozen=True, eq=False)
class Linearised:
    """The linear system of n nodes, with d dynamic unknowns and c − 1 parameters.

    transition (n - 1, d, d); drive (n - 1, d, 6 + s): what a step adds to the first columns: its defect, and what
    inertia and path have to do with it; first (d, c): the affine state at the first frame; observed (n, 6, d): position
    and attitude in B; information (n, 6, 6) on them and rhs (n, 6, c), affine in θ; static (c, c): the quadratic form
    of the cost of residuals at the reference; seen (n,): whether a node has observations.
    """

    transition: FloatArray
    drive: FloatArray
    first: FloatArray
    observed: FloatArray
    information: FloatArray
    rhs: FloatArray
    static: FloatArray
    seen: BoolArray

    @property
    def points(self) -> slice:
        """Where the points are among the parameters."""
        return points_in(self.drive.shape[2] - 1 - INERTIA)

    @cached_property
    def whitened(self) -> "Whitened":
        """The observations of unit variance."""
        values, axes = np.linalg.eigh(self.information)
        root = np.sqrt(np.where(values > LEAST * values[:, -1:], values, 0.0))
        from_pose = root[:, :, None] * axes.transpose(0, 2, 1)
        inverse = np.divide(1.0, root, out=np.zeros_like(root), where=root > 0)
        rhs = inverse[:, :, None] * (axes.transpose(0, 2, 1) @ self.rhs)
        rows = rhs.reshape(-1, rhs.shape[2])
        return Whitened(from_pose, from_pose @ self.observed, rhs, self.static - rows.T @ rows)


@dataclass(frozen=True, eq=False)
class Whitened:
    """The observations of a `Linearised` as six independent ones of variance 1 in each node, or of none.

    from_pose (n, 6, 6): T of position and attitude in B, of which TᵀT is the information; observed (n, 6, d): T G; rhs
    (n, 6, c): their values, affine in θ; left (c, c): the quadratic form of the cost that no state changes.
    """

    from_pose: FloatArray
    observed: FloatArray
    rhs: FloatArray
    left: FloatArray


def points_in(path_size: int) -> slice:
    """Where the points are among the parameters, for a path of that many unknowns."""
    return slice(INERTIA + path_size + 3, None)


def linearised(reference: Reference, nodes: Nodes, observations: Observations) -> Linearised:
    """The linear system about a reference, for observations in all frames."""
    path, attitude = reference.path, reference.attitude
    n, of_path = len(attitude), slice(1 + INERTIA, 1 + INERTIA + len(reference.x))
    c = of_path.stop + 3 + 3 * len(reference.points)
    after, rate, change = rotated(
        attitude[:-1], reference.rate[:-1], reference.inertia, reference.axis, np.diff(nodes.time)
    )
    transition = np.zeros((n - 1, STATE, STATE))
    transition[:, PATH, PATH] = path.transition
    transition[:, 6:, 6:] = change[:, :, :6]
    drive = np.zeros((n - 1, STATE, of_path.stop))
    went = path.transition @ reference.deviation[:-1, :, None] + path.drive @ reference.x[:, None]
    drive[:, PATH, 0] = went[:, :, 0] - reference.deviation[1:]
    drive[:, PATH, of_path] = path.drive
    drive[:, TURN, 0] = log_rotation(np.swapaxes(attitude[1:], 1, 2) @ after)
    drive[:, RATE, 0] = rate - reference.rate[1:]
    drive[:, 6:, 1 : 1 + INERTIA] = change[:, :, 6:]
    first = np.zeros((STATE, c))
    first[PATH, of_path] = path.columns[nodes.frames[0]]
    first[RATE, of_path.stop : of_path.stop + 3] = np.eye(3)
    observed = np.zeros((n, 6, STATE))
    observed[:, :3, :3] = np.swapaxes(attitude, 1, 2)
    observed[:, 3:, TURN] = np.eye(3)
    information, rhs, static = _measured(reference, nodes, observations, c)
    seen = np.zeros(n, dtype=bool)
    seen[nodes.frames] = (observations.weight > 0).any(axis=1)
    return Linearised(transition, drive, first, observed, information, rhs, static, seen)


def _measured(
    reference: Reference, nodes: Nodes, observations: Observations, c: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Information (n, 6, 6), rhs (n, 6, c), and static (c, c), see `Linearised`.

    A residual changes by −(τ − b × φ + δb), all in B, see `adjustment.normal_equations`.
    """
    frames, points = nodes.frames, reference.points
    R, w = reference.attitude[frames], observations.weight
    k, m = w.shape
    residual = (observations.position - reference.origin[frames][:, None]) @ R - points
    if observations.precision is None:
        P = w[:, :, None, None] * np.eye(3)
        weighted = w[:, :, None] * residual
    else:
        P = w[:, :, None, None] * (np.swapaxes(R, 1, 2)[:, None] @ observations.precision @ R[:, None])
        weighted = (P @ residual[..., None])[..., 0]
    arms = cross_matrices(points)
    levers = arms @ P
    own = np.zeros((k, 6, 6))
    own[:, :3, :3], own[:, 3:, :3] = P.sum(axis=1), levers.sum(axis=1)
    own[:, :3, 3:] = np.swapaxes(own[:, 3:, :3], 1, 2)
    own[:, 3:, 3:] = (levers @ np.swapaxes(arms, 1, 2)).sum(axis=1)
    n, from_points = len(reference.attitude), c - 3 * m
    information, rhs, static = np.zeros((n, 6, 6)), np.zeros((n, 6, c)), np.zeros((c, c))
    information[frames] = own
    rows = np.zeros((k, 6, c))
    rows[:, :3, 0] = weighted.sum(axis=1)
    rows[:, 3:, 0] = (arms @ weighted[..., None])[..., 0].sum(axis=1)
    rows[:, :3, from_points:] = -P.transpose(0, 2, 1, 3).reshape(k, 3, 3 * m)
    rows[:, 3:, from_points:] = -levers.transpose(0, 2, 1, 3).reshape(k, 3, 3 * m)
    rhs[frames] = rows
    static[0, 0] = np.vdot(weighted, residual)
    static[0, from_points:] = static[from_points:, 0] = -weighted.sum(axis=0).ravel()
    blocks = static[from_points:, from_points:].reshape(m, 3, m, 3)
    blocks[np.arange(m), :, np.arange(m)] = P.sum(axis=0)
    return information, rhs, static


def moved(reference: Reference, state: FloatArray, theta: FloatArray) -> Reference:
    """The reference changed by the dynamic state (n, d) and the parameters θ."""
    s = len(reference.x)
    return replace(
        reference,
        x=reference.x + theta[INERTIA : INERTIA + s],
        deviation=reference.deviation + state[:, PATH],
        attitude=reference.attitude @ exp_rotation(state[:, TURN]),
        rate=reference.rate + state[:, RATE],
        inertia=changed_inertia(reference.inertia, theta[:INERTIA]),
        points=reference.points + theta[points_in(s)].reshape(-1, 3),
    )
