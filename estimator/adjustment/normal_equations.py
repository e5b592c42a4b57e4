"""The blocks of the normal equations for the poses and points of a rigid body.

The model is p = g + R b: a feature at b in the body's axes B, whose origin g, the centre of mass, and attitude R move.
For small changes, φ the rotation vector in B and τ = Rᵀ δg, the residual in B changes by −(τ + δb − b × φ). So each
observation of weight P (its inverse covariance, rotated into B) adds to the frame's 6 × 6 block of (φ, τ), to the
feature's 3 × 3 block, and to the block that couples the two. This is not in the paper; it is the standard Gauss–Newton
step of bundle adjustment (Triggs et al. 2000), for observed points in space instead of images.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import FrameShifts
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.geometry.symmetric import inverted_sums, symmetric_inverses

FloatArray = NDArray[np.float64]
CHUNK_SIZE = 200_000  # numbers in the largest array of a chunk, so that it fits the processor's cache


@dataclass(frozen=True, eq=False)
class NormalBlocks:
    """The blocks of the normal equations of n frames with m observations, for poses (φ, τ) in B and points b.

    turn, shift (n, 3, 3): the frames' blocks of φ and of τ; turn_shift (n, 3, 3) couples them. point (m, 3, 3): the
    features' blocks, summed over the frames. Right-hand sides: turn_rhs, shift_rhs (n, 3), point_rhs (m, 3).
    squares (n, m): the weighted squared residuals. arms [b]× (m, 3, 3).
    """

    turn: FloatArray
    turn_shift: FloatArray
    shift: FloatArray
    point: FloatArray
    turn_rhs: FloatArray
    shift_rhs: FloatArray
    point_rhs: FloatArray
    squares: FloatArray
    arms: FloatArray
    _weight: FloatArray
    _precision: FloatArray | None

    def turn_points(self) -> FloatArray:
        """The blocks (n, 3, 3 m) that couple each frame's φ with the points."""
        if self._precision is None:
            m = len(self.arms)
            arms = np.ascontiguousarray(np.swapaxes(self.arms, 0, 1)).reshape(3, 3 * m)
            return np.asarray(arms * np.repeat(self._weight, 3, axis=1)[:, None, :])
        return _beside(np.einsum("mij,kmjl->kmil", self.arms, self._precision))

    def shift_points(self) -> FloatArray:
        """The blocks (n, 3, 3 m) that couple each frame's τ with the points."""
        if self._precision is None:
            return np.asarray(np.tile(np.eye(3), len(self.arms)) * np.repeat(self._weight, 3, axis=1)[:, None, :])
        return _beside(self._precision)

    def in_other_axes(self, attitude: FloatArray) -> FloatArray:
        """For the same weights along all axes, the blocks w R (n, 3, 3 m) that couple each frame's R τ with the points.

        attitude (n, 3, 3). Those with R φ are w R [b]×.
        """
        n, m = self._weight.shape
        blocks = self._weight[:, None, :, None] * np.asfortranarray(attitude)[:, :, None]
        return blocks.reshape(n, 3, 3 * m)

    def shift_alone(self) -> tuple[FloatArray, FloatArray]:
        """The frames' blocks of τ (n, 3, 3) with φ unknown, and their right-hand sides (n, 3)."""
        back = np.einsum("kji,kjl->kil", self.turn_shift, symmetric_inverses(self.turn))
        left = self.shift - np.einsum("kij,kjl->kil", back, self.turn_shift)
        return left, self.shift_rhs - np.einsum("kij,kj->ki", back, self.turn_rhs)

    def turn_alone(self, shift: FloatArray) -> FloatArray:
        """The frames' information (n, 3, 3) on φ with τ unknown, of covariance shift (n, 3, 3) in B, over the variance
        of an observation of weight 1.
        """
        return self.turn - self.turn_shift @ inverted_sums(shift, self.shift) @ np.swapaxes(self.turn_shift, 1, 2)

    def of_poses(self) -> tuple[FloatArray, FloatArray]:
        """The frames' blocks (n, 6, 6) of (φ, τ), and their right-hand sides (n, 6)."""
        n = len(self.turn)
        block = np.empty((n, 6, 6))
        block[:, :3, :3], block[:, :3, 3:], block[:, 3:, 3:] = self.turn, self.turn_shift, self.shift
        block[:, 3:, :3] = np.swapaxes(self.turn_shift, 1, 2)
        return block, np.concatenate([self.turn_rhs, self.shift_rhs], axis=1)

    def poses_points(self) -> FloatArray:
        """The blocks (n, 6, 3 m) that couple each frame's (φ, τ) with the points."""
        return np.concatenate([self.turn_points(), self.shift_points()], axis=1)

    def best_pose(self, prior: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """The changes φ (n, 3) and τ (n, 3) of each frame's pose that fit best for the same points.

        prior (n, 3, 3): the covariance of τ, over the variance of an observation of weight 1; without a bound if None.
        """
        information, rhs = self.shift_alone()
        inverse = symmetric_inverses(information) if prior is None else inverted_sums(prior, information)
        shift = np.einsum("kij,kj->ki", np.asfortranarray(inverse), rhs)
        left = self.turn_rhs - np.einsum("kij,kj->ki", self.turn_shift, shift)
        return np.einsum("kij,kj->ki", symmetric_inverses(self.turn), left), shift

    def mean(self, residual: FloatArray) -> FloatArray:
        """The means (m, 3) over the frames of residuals (n, m, 3) in B, with their weights."""
        if self._precision is None:
            total = np.einsum("km,kmi->mi", self._weight, residual)
        else:
            total = np.einsum("kmij,kmj->mi", self._precision, residual)
        return np.asarray((np.linalg.pinv(self.point, hermitian=True) @ total[:, :, None])[:, :, 0])

    def unknowns_points(self, turn: FloatArray | None, shift: FloatArray) -> FloatArray:
        """The block (p, 3 m) that couples p unknowns with the points.

        turn (None: zero) and shift (n, 3, p): Jacobians of φ and τ by these unknowns.
        """
        n, m = self._weight.shape
        p = shift.shape[2]
        if self._precision is None:
            by_shift = (self._weight.T @ shift.reshape(n, 3 * p)).reshape(m, 3, p)
            if turn is not None:
                by_turn = (self._weight.T @ turn.reshape(n, 3 * p)).reshape(m, 3, p)
                by_shift = by_shift + np.swapaxes(self.arms, 1, 2) @ by_turn
            return np.asarray(by_shift.reshape(3 * m, p).T)
        moved = np.broadcast_to(shift[:, None], (n, m, 3, p))
        if turn is not None:
            moved = moved + np.swapaxes(self.arms, 1, 2) @ turn[:, None]
        return np.asarray(np.einsum("kmij,kmjp->pmi", self._precision, moved, optimize=True).reshape(p, 3 * m))


def normal_blocks(
    observations: Observations, attitude: FloatArray, origin: FloatArray, points: FloatArray
) -> NormalBlocks:
    """The blocks of the normal equations at attitude (n, 3, 3) R_C_B, origin (n, 3) in C, m, points (m, 3) in B, m."""
    return _seen(observations, origin, points).normal_blocks(attitude)


def at_best_attitudes(
    observations: Observations,
    attitude: FloatArray,
    origin: FloatArray,
    points: FloatArray,
    shifts: FrameShifts | None = None,
) -> tuple[FloatArray, NormalBlocks]:
    """The attitudes (n, 3, 3) after one Gauss–Newton step with points and origin fixed, and the blocks there.

    shifts: of the n frames, as far as which the origin is free. Other arguments as in `normal_blocks`.
    """
    seen = _seen(observations, origin, points)
    if shifts is None:
        turn = seen.best_turns(attitude)
    else:
        turn, _ = seen.normal_blocks(attitude).best_pose(shifts.in_body(attitude))
    best = attitude @ exp_rotation(turn)
    return best, seen.normal_blocks(best)


def _seen(observations: Observations, origin: FloatArray, points: FloatArray) -> "_Isotropic | _Anisotropic":
    """The observations from origins (n, 3) in C of points (m, 3) in B."""
    if observations.precision is None:
        return _Isotropic.of(observations, origin, points)
    return _Anisotropic.of(observations, observations.precision, origin, points)


@dataclass(frozen=True, eq=False)
class _Isotropic:
    """Observations of the same weight along all axes, from the centre of mass, and what holds for all attitudes.

    offset d (n, m, 3) in C; total Σ w d (n, 3) and moments Σ w b dᵀ (n, 3, 3); turn (n, 3, 3): the block of φ in B.
    In memory the frames come last, so that einsum runs along them, in a quarter of the time of matmul.
    """

    weight: FloatArray
    points: FloatArray
    arms: FloatArray
    offset: FloatArray
    total: FloatArray
    moments: FloatArray
    turn: FloatArray

    @classmethod
    def of(cls, observations: Observations, origin: FloatArray, points: FloatArray) -> "_Isotropic":
        """The blocks of points (m, 3) in B, for origins (n, 3) in C."""
        w, arms = np.asfortranarray(observations.weight), cross_matrices(points)
        offset = np.asfortranarray(observations.position) - np.asfortranarray(origin)[:, None]
        weighted = w[:, :, None] * offset
        moments = (points.T @ weighted.T).T
        return cls(w, points, arms, offset, np.einsum("kmi->ki", weighted), moments, turn_information(w, arms))

    def best_turns(self, attitude: FloatArray) -> FloatArray:
        """The rotation vectors (n, 3) in B from attitudes (n, 3, 3) to the best ones, in one step."""
        rhs = _cross_sums(self.moments, np.asfortranarray(attitude))
        return np.asarray(np.einsum("kij,kj->ki", symmetric_inverses(self.turn), rhs))

    def normal_blocks(self, attitude: FloatArray) -> NormalBlocks:
        """See `normal_blocks`."""
        w, attitude = self.weight, np.asfortranarray(attitude)
        residual = np.einsum("kmj,kji->kmi", self.offset, attitude)
        residual -= self.points
        return NormalBlocks(
            turn=self.turn,
            turn_shift=_sums(w, self.arms),
            shift=(np.eye(3)[:, :, None] * w.sum(axis=1)).T,
            point=w.sum(axis=0)[:, None, None] * np.eye(3),
            turn_rhs=_cross_sums(self.moments, attitude),
            shift_rhs=np.einsum("kj,kji->ki", self.total, attitude) - w @ self.points,
            point_rhs=np.einsum("km,kmi->mi", w, residual),
            squares=w * np.einsum("kmi,kmi->km", residual, residual),
            _weight=w,
            arms=self.arms,
            _precision=None,
        )


@dataclass(frozen=True, eq=False)
class _Anisotropic:
    """Observations with precisions, from the centre of mass: as `_Isotropic`, precision w P (n, m, 3, 3) in C."""

    weight: FloatArray
    points: FloatArray
    arms: FloatArray
    offset: FloatArray
    precision: FloatArray

    @classmethod
    def of(
        cls, observations: Observations, precision: FloatArray, origin: FloatArray, points: FloatArray
    ) -> "_Anisotropic":
        """The blocks of points (m, 3) in B, for origins (n, 3) in C."""
        w = np.asfortranarray(observations.weight)
        offset = np.asfortranarray(observations.position) - np.asfortranarray(origin)[:, None]
        weighted = w[:, :, None, None] * np.asfortranarray(precision)
        return cls(w, points, cross_matrices(points), offset, weighted)

    def best_turns(self, attitude: FloatArray) -> FloatArray:
        """The rotation vectors (n, 3) in B from attitudes (n, 3, 3) to the best ones, in one step."""
        precision, _, weighted = self._in_body(np.asfortranarray(attitude))
        turn = np.einsum("kmij,mlj->kil", self._levers(precision), self.arms)
        return np.asarray(np.einsum("kij,kj->ki", symmetric_inverses(turn), self._torques(weighted)))

    def normal_blocks(self, attitude: FloatArray) -> NormalBlocks:
        """See `normal_blocks`."""
        precision, residual, weighted = self._in_body(np.asfortranarray(attitude))
        levers = self._levers(precision)
        return NormalBlocks(
            turn=np.einsum("kmij,mlj->kil", levers, self.arms),
            turn_shift=levers.sum(axis=1),
            shift=precision.sum(axis=1),
            point=precision.sum(axis=0),
            turn_rhs=self._torques(weighted),
            shift_rhs=np.einsum("kmi->ki", weighted),
            point_rhs=weighted.sum(axis=0),
            squares=np.einsum("kmi,kmi->km", weighted, residual),
            _weight=self.weight,
            arms=self.arms,
            _precision=precision,
        )

    def _in_body(self, attitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """In B: precisions (n, m, 3, 3), residuals (n, m, 3), and both multiplied."""
        half = np.einsum("kmij,kjl->kmil", self.precision, attitude)
        precision = np.einsum("kji,kmjl->kmil", attitude, half)
        residual = np.einsum("kmj,kji->kmi", self.offset, attitude)
        residual -= self.points
        return precision, residual, np.einsum("kmij,kmj->kmi", precision, residual)

    def _levers(self, precision: FloatArray) -> FloatArray:
        """[b]× P (n, m, 3, 3) for precisions in B."""
        return np.asarray(np.einsum("mij,kmjl->kmil", self.arms, precision))

    def _torques(self, weighted: FloatArray) -> FloatArray:
        """Σ b × P r (n, 3)."""
        return np.asarray(np.einsum("mij,kmj->ki", self.arms, weighted))


def _beside(blocks: FloatArray) -> FloatArray:
    """Blocks (n, m, 3, 3) of m points beside each other, (n, 3, 3 m), with the frames last in memory."""
    n, m = blocks.shape[:2]
    return np.ascontiguousarray(blocks.transpose(1, 3, 2, 0)).reshape(3 * m, 3, n).T


def _sums(weight: FloatArray, matrices: FloatArray) -> FloatArray:
    """Σ w A (n, 3, 3) for weights (n, m) and matrices (m, 3, 3), with the frames last in memory."""
    n, m = weight.shape
    return np.asarray((np.swapaxes(matrices, 1, 2).reshape(m, 9).T @ weight.T).reshape(3, 3, n).T)


def attitude_information(
    observations: Observations, attitude: FloatArray, points: FloatArray, shifts: FrameShifts | None = None
) -> FloatArray:
    """The information (n, 3, 3) in B, 1/rad², on the attitude (n, 3, 3) R_C_B, with points (m, 3) and origin known.

    shifts: of the n frames, but for which the origin is known. The observations' weights are inverse variances; other
    weights scale the information.
    """
    if shifts is not None:
        found = normal_blocks(observations, attitude, np.zeros((len(attitude), 3)), points)
        return found.turn_alone(shifts.in_body(attitude))
    arms = cross_matrices(points)
    if observations.precision is None:
        return turn_information(observations.weight, arms)
    R = attitude[:, None]
    P = observations.weight[:, :, None, None] * (np.swapaxes(R, 2, 3) @ observations.precision @ R)
    return np.asarray(np.einsum("mij,kmjl,mnl->kin", arms, P, arms, optimize=True))


def attitude_covariances(information: FloatArray, variance: float) -> FloatArray:
    """The covariances (n, 3, 3) in rad² of attitudes of this information (n, 3, 3), for a variance of weight 1.

    An attitude that is not known at all is off by a radian or two, so that C is bounded by (1 + C⁻¹)⁻¹.
    """
    bounded = information + variance * np.eye(3)
    found = symmetric_inverses(bounded)
    singular = ~found.any(axis=(1, 2))
    if singular.any():  # for cofactors
        values, vectors = np.linalg.eigh(bounded[singular])
        least = max(variance, 1e-300)  # the information has no negative one but by rounding
        found[singular] = (vectors / np.maximum(values, least)[:, None]) @ np.swapaxes(vectors, 1, 2)
    return variance * found


def turn_information(weight: FloatArray, arms: FloatArray) -> FloatArray:
    """Σ w [b]× [b]×ᵀ for each frame, (n, 3, 3), from weights (n, m) and arms [b]× (m, 3, 3)."""
    return _sums(weight, arms @ np.swapaxes(arms, 1, 2))


def _cross_sums(moments: FloatArray, attitude: FloatArray) -> FloatArray:
    """Σ b × Rᵀ d (n, 3) from Σ b dᵀ (n, 3, 3) and R (n, 3, 3)."""
    turned = np.einsum("kij,kjl->kil", moments, attitude)
    return np.stack(
        [turned[:, 1, 2] - turned[:, 2, 1], turned[:, 2, 0] - turned[:, 0, 2], turned[:, 0, 1] - turned[:, 1, 0]]
    ).T
