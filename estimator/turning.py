"""Where a turning body carries a point of it, and how uncertain that is: in the tracks, and far away from them.

A point b of the body is at g + R b and has the velocity ġ + R (ω × b). Where something is seen, errors of attitude and
rate are small, and to first order, with the arc of the attitude in second, all is told. Away from the tracks they grow
with time, the more so as the inertia is uncertain: the motion of a body whose inertia is another is no multiple of a
small change. There, members of the posterior at the end of the tracks are turned each by its own motion. Their mean and
covariance at that end are exactly those of the posterior, so that to first order they are so everywhere. Features were
seen until then: what errors of b and of the attitude or the axis displace together, the path has the opposite of.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.growth import rotation_growth
from baryscope.estimator.dynamics.many_bodies import motions
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, SHORT_NODE_ANGLE, Attitudes, Rotation, diverged
from baryscope.estimator.dynamics.torque import LastingTorque, Torque
from baryscope.estimator.geometry.members import opposite_pairs, root_of
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]
# A turn (3,) in B, rad, changes of the rate (3,), rad/s, and of five unknowns of the inertia → the rotation then
Changed = Callable[[FloatArray, FloatArray, FloatArray], Rotation]

OF_MOTION = 11  # unknowns: attitude, rate and inertia
MOST_NODES = 20_000  # of a member in the mean, half a radian each: a quarter of a minute for all members
SHORTER = (1.0, 0.5, 0.25, 0.0)  # of a member's way, until its motion can be followed


def carried(R: FloatArray, rate: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and velocity (n, 6) in C of a point b (3,) in B that turns about the centre of mass.

    R (n, 3, 3) R_C_B, of which a change is a rotation vector in B; rate (n, 3), rad/s in B. Also the Jacobians
    (n, 6, 6) by attitude and rate, and (n, 6, 3) by b.
    """
    by_arm, speed = -R @ cross_matrices(b[None]), np.cross(rate, b)
    by_turn = np.concatenate([by_arm, -R @ cross_matrices(speed)], axis=1)
    by_motion = np.concatenate([by_turn, np.concatenate([np.zeros_like(R), by_arm], axis=1)], axis=2)
    by_b = np.concatenate([R, R @ cross_matrices(rate)], axis=1)
    return arm_of(R, rate, b), by_motion, by_b


def arm_of(R: FloatArray, rate: FloatArray, b: FloatArray) -> FloatArray:
    """The position and velocity (..., 6) alone, of points b (..., 3) or of one."""
    moved = np.stack(np.broadcast_arrays(b, np.cross(rate, b)), axis=-1)
    return np.asarray(np.swapaxes(R @ moved, -2, -1).reshape(*rate.shape[:-1], 6))


def curved(R: FloatArray, rate: FloatArray, b: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What the second order of an attitude's error θ, of covariance turn (n, 3, 3), does to a point, see `carried`.

    θ moves c, which is b or ω × b, by θ × c + ½ θ × (θ × c). The last term's coordinates are θᵀ A θ with symmetric A,
    of mean tr(A Θ) and covariances 2 tr(A Θ A′ Θ) (Isserlis). Errors of more than a radian are taken for one: a point
    stays at its distance.

    Returns:
        The means (n, 6) and covariances (n, 6, 6) of position and velocity in C.
    """
    size = np.trace(turn, axis1=1, axis2=2)
    turn = turn / np.maximum(size, 1.0)[:, None, None]
    moved, axes = np.stack([np.broadcast_to(b, rate.shape), np.cross(rate, b)], axis=1), np.eye(3)
    A = 0.25 * (axes[:, :, None] * moved[:, :, None, None, :] + moved[:, :, None, :, None] * axes[:, None, :])
    A -= 0.5 * moved[..., None, None] * axes
    by_turn = (A @ turn[:, None, None]).reshape(len(turn), 6, 3, 3)
    mean = np.trace(by_turn, axis1=2, axis2=3).reshape(-1, 2, 3)
    covariance = 2 * np.einsum("niab,njba->nij", by_turn, by_turn).reshape(-1, 2, 3, 2, 3)
    in_C = np.einsum("nab,npbqc,ndc->npaqd", R, covariance, R)
    return (mean @ np.swapaxes(R, 1, 2)).reshape(-1, 6), in_C.reshape(-1, 6, 6)


@dataclass(frozen=True, eq=False)
class TurningPoint:
    """What is known together at a time, beyond which nothing is seen: of a body's motion, and of a point of it.

    rotation: with that time as its epoch, under no torque but gravity's; changed: see `Changed`; b (3,) in B, m;
    covariance (v, v) of attitude, rate and inertia, as `changed` takes them, of v − 14 unknowns of the path, and of b;
    torque_density: of white noise from there on, rad²/s³; lasting: a torque that goes on there.
    """

    rotation: Rotation
    changed: Changed
    b: FloatArray
    covariance: FloatArray
    torque_density: float
    lasting: LastingTorque | None = None

    def away(self, time: FloatArray, state: FloatArray, by_path: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) of the point in C, and their covariance (n, 6, 6), at times (n,) on one side.

        state: those (n, 6) of the centre of mass, with their Jacobian (n, 6, v − 14) by the path's unknowns.

        Raises:
            ComputationError: the rotation cannot be followed so far.
        """
        root, others, rest = self._parts()
        ways = opposite_pairs(root.shape[1])
        went = ways @ others.T
        changes = ways @ root.T
        self._refuse_too_many_turns(changes, time)
        motion, count = self.rotation.at(time, SHORT_NODE_ANGLE), by_path.shape[2]
        own = self._with_axis(changes, went[:, count:])
        arms = self._arms(changes, self.b + own, motion)
        members = arms + np.moveaxis(by_path @ went[:, :count].T, 2, 0)
        carried_on = _turned(changes[:, :3], own)
        members[:, :, :3] -= ((carried_on - went[:, count:]) @ self.rotation.attitude.T)[:, None]  # as the path has it
        mean = members.mean(axis=0)
        off = members - mean
        turned = rotation_growth(
            self.rotation, motion, self.torque_density, self.rotation.epoch, self.rotation.epoch, time
        )
        _, by_motion, by_b = carried(motion.attitude, motion.rate, self.b)
        by_rest = np.concatenate([by_path, by_b], axis=2)
        covariance = np.einsum("kni,knj->nij", off, off, optimize=True) / len(members)
        covariance += by_rest @ rest @ np.swapaxes(by_rest, 1, 2) + by_motion @ turned @ np.swapaxes(by_motion, 1, 2)
        shift, arc = curved(motion.attitude, motion.rate, self.b, turned[:, :3, :3])
        moved, by_torque = self._by_torque(motion, time)
        return state + mean + shift + moved, covariance + arc + by_torque

    def _by_torque(self, free: Attitudes, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the torque that lasts changes: position and velocity (n, 6) in C, and the covariance (n, 6, 6)."""
        if self.lasting is None or not len(time):
            return np.zeros((len(time), 6)), np.zeros((len(time), 6, 6))
        epoch = self.rotation.epoch
        ends = min(epoch, float(time.min())), max(epoch, float(time.max()))
        torque = Torque.constant(self.lasting.mean, *ends)
        pushed = replace(self.rotation, torque=torque).at(time, SHORT_NODE_ANGLE)
        moved, by_motion, _ = carried(pushed.attitude, pushed.rate, self.b)
        own = slice(RATE_AND_INERTIA, None)
        response = np.concatenate([pushed.turn[:, :, own], pushed.rate_sensitivity[:, :, own]], axis=1)
        by_torque = np.sqrt(ends[1] - ends[0]) * by_motion @ response
        of_torque = by_torque @ self.lasting.covariance @ np.swapaxes(by_torque, 1, 2)
        return moved - arm_of(free.attitude, free.rate, self.b), of_torque

    def _parts(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A root (11, k) of the motion's covariance, what the others (v - 11, k) do with it, and their rest."""
        root, inverse = root_of(self.covariance[:OF_MOTION, :OF_MOTION])
        along = self.covariance[OF_MOTION:, :OF_MOTION] @ inverse
        return root, along, self.covariance[OF_MOTION:, OF_MOTION:] - along @ along.T

    def _with_axis(self, changes: FloatArray, of_b: FloatArray) -> FloatArray:
        """The changes of b (m, 3) of members, turned as changes (m, 11) turn their axes of rotation.

        Along the axis of a spin nothing tells b: what it changes by lies along each member's own axis, and stays there.
        """
        before, after = self.rotation.rate, self.rotation.rate + changes[:, 3:6]
        across = np.cross(before, after)
        sine = np.linalg.norm(across, axis=1, keepdims=True)
        angle = np.arctan2(sine, (after @ before)[:, None])
        return _turned(angle * across / np.maximum(sine, 1e-300), of_b)

    def _refuse_too_many_turns(self, changes: FloatArray, time: FloatArray) -> None:
        """Refuse times (n,) to which members, of changes (m, 11), turn more often than can be followed.

        Raises:
            ComputationError: they do.
        """
        far = float(np.abs(time - self.rotation.epoch).max(initial=0.0))
        nodes = far * float(np.mean([1 / one.longest_step for one in self._members(changes)]))
        if nodes > MOST_NODES:
            rate, off = np.linalg.norm(self.rotation.rate), np.sqrt((changes[:, 3:6] ** 2).sum(axis=1).mean())
            raise ComputationError(
                f"times: found {far:.3g} s away from the tracks, expected {far * MOST_NODES / nodes:.3g} s at most for "
                f"a point: the target turns at {rate:.3g} ± {off:.2g} rad/s",
                Reason.TOO_LONG,
            )

    def _members(self, changes: FloatArray) -> list[Rotation]:
        """The rotations of members, of changes (m, 11)."""
        return [self.changed(*np.split(one, [3, 6])) for one in changes]

    def _arms(self, changes: FloatArray, b: FloatArray, motion: Attitudes) -> FloatArray:
        """Position and velocity (m, n, 6) in C from the centre of mass of members: changes (m, 11), points b (m, 3).

        motion: at the n times, of none of these changes.
        """
        arms, left = np.empty((len(changes), len(motion.time), 6)), np.arange(len(changes))
        for share in SHORTER:
            R, rate, followed = motions(self._members(share * changes[left]), self.rotation, motion)
            done = left[followed]
            arms[done] = arm_of(R[followed], rate[followed], b[done, None])
            left = left[~followed]
            if not len(left):
                return arms
        raise diverged()


def _turned(turn: FloatArray, vectors: FloatArray) -> FloatArray:
    """Vectors (m, 3) turned by rotation vectors (m, 3), rad."""
    return np.asarray((exp_rotation(turn) @ vectors[:, :, None])[:, :, 0])
