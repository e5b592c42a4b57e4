"""The estimation problem of `ekf`, linearised about a reference motion.

The dynamic state at a node is s = (u, φ, ω): deviations of the path's u, m, of the attitude, a rotation vector in B,
and of the rate. Unknowns that are constant or initial values are the parameters θ = (five of the inertia, x of the
path, ω at the first node, points). Means are affine in θ: they are held as matrices whose first column is the mean for
θ = 0 and whose others are its derivatives by θ (de Jong's augmentation).

What a camera turns and shifts in a frame as a whole, by errors that are constant, `camera`, are unknowns among those of
the path; by noise of its attitude, new in every frame, it takes from the frame's information (`FrameNoise`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from baryscope.estimator.adjustment.normal_equations import normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.ekf.camera import CameraErrors
from baryscope.estimator.ekf.motion import ROTATION, PathProcess, changed_inertia, rotated
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation, log_rotation
from baryscope.estimator.ml.model import FrameNoise
from baryscope.estimator.tracks import BoolArray, FloatArray, IntArray

INERTIA = ROTATION - 6  # unknowns of the inertia
STATE = 12  # unknowns at a node
LEAST = 1e-15  # eigenvalue of a node's information over the greatest: a smaller one is rounding
PATH, TURN, RATE = slice(0, 6), slice(6, 9), slice(9, STATE)  # of these
SWAPPED = np.r_[3:6, 0:3]  # attitude before position, as in `FrameNoise`, and back


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
    `motion.rotated`; camera: its constant errors, None if it has none.
    """

    path: PathProcess
    x: FloatArray
    deviation: FloatArray
    attitude: FloatArray
    rate: FloatArray
    inertia: FloatArray
    points: FloatArray
    axis: FloatArray
    camera: CameraErrors | None = None

    @property
    def origin(self) -> FloatArray:
        """The centre of mass in C, (n, 3), m."""
        return self.path.position(self.deviation)

    def as_seen(self, nodes: Nodes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Attitude (frames, 3, 3) and origin (frames, 3) in C, m, and points (m, 3) in B, m, as a camera sees them."""
        attitude, origin = self.attitude[nodes.frames], self.origin[nodes.frames]
        if self.camera is None:
            return attitude, origin, self.points
        return self.camera.seen(attitude, origin, self.points)

    def seen_at(self, nodes: Nodes) -> FloatArray:
        """The positions (frames, m, 3) of the points in C, m, as the camera sees them."""
        attitude, origin, points = self.as_seen(nodes)
        return np.asarray(points @ np.swapaxes(attitude, 1, 2) + origin[:, None])


@dataclass(frozen=True, eq=False)
class Linearised:
    """The linear system of n nodes, with d dynamic unknowns and c − 1 parameters.

    transition (n - 1, d, d); drive (n - 1, d, 6 + s): what a step adds to the first columns: its defect, and what
    inertia and path have to do with it; first (d, c): the affine state at the first frame; observed (n, 6, d): position
    and attitude in B; information (n, 6, 6) on them and rhs (n, 6, c), affine in θ; static (c, c): the quadratic form
    of the cost of residuals at the reference; seen (n,): whether a node has observations. turned (n, 3, c - 1): what
    parameters turn the attitude by in B as it is seen, beside the state, None if nothing; log_determinant: of the
    observations' covariances with the noise of whole frames, over those without.
    """

    transition: FloatArray
    drive: FloatArray
    first: FloatArray
    observed: FloatArray
    information: FloatArray
    rhs: FloatArray
    static: FloatArray
    seen: BoolArray
    turned: FloatArray | None = None
    log_determinant: float = 0.0

    def turns_seen(self, turns: FloatArray, by_theta: FloatArray) -> FloatArray:
        """What turns the attitude in B as it is seen (n, 3, k), for turns of the state and changes (c - 1, k) of θ."""
        return turns if self.turned is None else turns + self.turned @ by_theta

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


def linearised(
    reference: Reference, nodes: Nodes, observations: Observations, noise: FrameNoise | None = None
) -> Linearised:
    """The linear system about a reference, for observations in all frames, and the noise of whole frames."""
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
    measured = _measured(reference, nodes, observations, c)
    turned = None
    if reference.camera is not None:
        own = slice(1 + INERTIA + reference.camera.own.start, 1 + INERTIA + reference.camera.own.stop)
        movements = reference.camera.movements(reference.as_seen(nodes)[0], reference.origin[nodes.frames])
        measured = measured.moved(own, movements, reference.camera.growths(reference.points))
        turned = np.zeros((n, 3, c - 1))
        turned[nodes.frames, :, own.start - 1 : own.stop - 1] = movements[:, 3:]
    log_determinant = 0.0
    if noise is not None:
        measured, log_determinant = measured.under_noise(noise, *reference.as_seen(nodes)[:2])
    information, rhs = np.zeros((n, 6, 6)), np.zeros((n, 6, c))
    information[nodes.frames], rhs[nodes.frames] = measured.information, measured.rhs
    seen = np.zeros(n, dtype=bool)
    seen[nodes.frames] = (observations.weight > 0).any(axis=1)
    return Linearised(
        transition, drive, first, observed, information, rhs, measured.static, seen, turned, log_determinant
    )


@dataclass(frozen=True, eq=False)
class _Measured:
    """What k frames tell of position τ and attitude φ in B: information (k, 6, 6), rhs (k, 6, c) and static (c, c), see
    `Linearised`.
    """

    information: FloatArray
    rhs: FloatArray
    static: FloatArray

    def moved(self, own: slice, movements: FloatArray, growths: FloatArray) -> "_Measured":
        """With e parameters, of these columns, that move the body in each frame, as it is seen, by movements (k, 6, e),
        and its points by growths (3 m, e).
        """
        by_points = np.eye(len(self.static))
        by_points[len(self.static) - len(growths) :, own] = growths
        rhs, static = self.rhs @ by_points, by_points.T @ self.static @ by_points
        crossed = np.tensordot(movements, rhs, ((0, 1), (0, 1)))
        told = self.information @ movements
        static[own] -= crossed
        static[:, own] -= crossed.T
        static[own, own] += np.tensordot(movements, told, ((0, 1), (0, 1)))
        rhs[:, :, own] -= told
        return _Measured(self.information, rhs, static)

    def under_noise(self, noise: FrameNoise, attitude: FloatArray, origin: FloatArray) -> tuple["_Measured", float]:
        """What is left under noise that moves whole frames, and by how much the logarithm of the determinant of the
        observations' covariance grows; attitude (k, 3, 3) and origin (k, 3) in C, m, as seen.
        """
        gain = noise.gain(self.information[:, SWAPPED][:, :, SWAPPED], attitude, origin)[:, SWAPPED][:, :, SWAPPED]
        left = np.eye(6) - self.information @ gain
        rows = gain @ self.rhs
        information = left @ self.information
        found = _Measured(
            (information + np.swapaxes(information, 1, 2)) / 2,
            left @ self.rhs,
            self.static - np.tensordot(self.rhs, rows, ((0, 1), (0, 1))),
        )
        return found, -float(np.linalg.slogdet(left)[1].sum())


def _measured(reference: Reference, nodes: Nodes, observations: Observations, c: int) -> _Measured:
    """What the frames tell for known errors of the camera.

    A residual changes by −(τ − b × φ + δb), all in B, see `adjustment.normal_equations`.
    """
    R, origin, points = reference.as_seen(nodes)
    w = observations.weight
    k, m = w.shape
    residual = (observations.position - origin[:, None]) @ R - points
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
    from_points = c - 3 * m
    static = np.zeros((c, c))
    rows = np.zeros((k, 6, c))
    rows[:, :3, 0] = weighted.sum(axis=1)
    rows[:, 3:, 0] = (arms @ weighted[..., None])[..., 0].sum(axis=1)
    rows[:, :3, from_points:] = -P.transpose(0, 2, 1, 3).reshape(k, 3, 3 * m)
    rows[:, 3:, from_points:] = -levers.transpose(0, 2, 1, 3).reshape(k, 3, 3 * m)
    static[0, 0] = np.vdot(weighted, residual)
    static[0, from_points:] = static[from_points:, 0] = -weighted.sum(axis=0).ravel()
    blocks = static[from_points:, from_points:].reshape(m, 3, m, 3)
    blocks[np.arange(m), :, np.arange(m)] = P.sum(axis=0)
    return _Measured(own, rows, static)


def residuals(reference: Reference, nodes: Nodes, observations: Observations, noise: FrameNoise | None) -> FloatArray:
    """The residuals (frames, m, 3) in C, m, without the likeliest movements of whole frames by noise."""
    attitude, origin, points = reference.as_seen(nodes)
    residual = observations.position - points @ np.swapaxes(attitude, 1, 2) - origin[:, None]
    if noise is None:
        return residual
    block, rhs = normal_blocks(observations, attitude, origin, points).of_poses()
    return residual - noise.carried(noise.movements(block, rhs, attitude, origin), attitude, points)


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
        camera=None if reference.camera is None else reference.camera.moved(theta[INERTIA : INERTIA + s]),
    )
