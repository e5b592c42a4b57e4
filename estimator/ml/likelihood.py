"""Joint normal equations of a tumbling body whose centre of mass moves on a path, observed by its features.

The unknowns y are those of the rotation (rate and inertia at the epoch, modes of a torque) and the path's x. The
attitude at the epoch defines the body's axes and is no unknown. The model is linear in the points b, which are
eliminated (variable projection). The inverse of these normal equations is the Cramér–Rao bound at the true values, and
the covariance at the estimate, without a prior.

A frame may be shifted and turned as a whole, by a camera of noisy attitude or a pivot that slips. With W the weights of
the frame's observations, H their Jacobian by such a movement and C its covariance, the frame's weights become
W − W H (C⁻¹ + Hᵀ W H)⁻¹ Hᵀ W (Woodbury), which couples its points.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, NormalBlocks, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.dynamics.blocks import PAIRS
from baryscope.estimator.dynamics.rotation import Attitudes
from baryscope.estimator.dynamics.sampled_path import SampledPath
from baryscope.estimator.geometry.gauge import offset_by_points
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.geometry.symmetric import null_space_of, symmetric_pseudo_inverse
from baryscope.estimator.ml.jacobians import Knots, KnotsAround

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FrameNoise:
    """Movements of all points of a frame together, independent from frame to frame: their covariances in C.

    turn (n, 3, 3): of a rotation about the origin of C, rad², as by the camera's attitude; shift (n, 3, 3): of a
    translation, m². For weights that are inverse variances; other weights scale both by the variance of weight 1.
    """

    turn: FloatArray
    shift: FloatArray

    def of_poses(self, attitude: FloatArray, origin: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) as movements (φ, τ) in B, of bodies with attitude (n, 3, 3) at origin (n, 3)."""
        R_B_C = np.swapaxes(attitude, 1, 2)
        by_turn = np.concatenate([R_B_C, -R_B_C @ cross_matrices(origin)], axis=1)
        by_shift = np.concatenate([np.zeros_like(R_B_C), R_B_C], axis=1)
        return np.asarray(
            by_turn @ self.turn @ np.swapaxes(by_turn, 1, 2) + by_shift @ self.shift @ np.swapaxes(by_shift, 1, 2)
        )

    def frames(self, part: slice) -> "FrameNoise":
        """That of some frames."""
        return FrameNoise(self.turn[part], self.shift[part])


@dataclass(frozen=True, eq=False)
class Model:
    """Motion, path and frame noise at the frames, and points, at which the equations are linearised.

    motion and path sampled at the frames, the path as it is seen; origin (n, 3): its positions in C, m; points (m, 3)
    in B, m. knots: Jacobians for blocks of frames; None: those of every frame. turned (n, 3): the rotation vectors in C
    by which a camera sees the attitudes turned.
    """

    motion: Attitudes
    path: SampledPath
    origin: FloatArray
    points: FloatArray
    noise: FrameNoise | None = None
    knots: Knots | None = None
    turned: FloatArray | None = None

    @cached_property
    def attitude(self) -> FloatArray:
        """The attitudes (n, 3, 3) as they are seen."""
        R = self.motion.attitude
        return R if self.turned is None else exp_rotation(self.turned) @ R

    @property
    def rotation_size(self) -> int:
        """The number of the rotation's unknowns."""
        return self.motion.size

    @property
    def size(self) -> int:
        """The number of unknowns y."""
        return self.rotation_size + self.path.size


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations after the elimination of the points, for weights that are inverse variances.

    matrix (q, q) and rhs (q,) of y = (rotation, x); rotation_size: how many belong to the rotation; sizes (q,): the
    matrix's diagonal before the elimination; points (m, 3) in B, m: the optimal ones for this motion and path; squares
    (n, m): weighted squared residuals with these points; noise_cost: the squares of the frames' own movements;
    points_covariance (3 m, 3 m): that of the points conditional on y, or (m, 3, 3) if they are independent then;
    by_unknowns (3 m, q): a change δy changes the points by −by_unknowns δy.
    """

    matrix: FloatArray
    rotation_size: int
    sizes: FloatArray
    rhs: FloatArray
    points: FloatArray
    squares: FloatArray
    noise_cost: float
    points_covariance: FloatArray
    by_unknowns: FloatArray

    @property
    def cost(self) -> float:
        """The weighted sum of squared residuals, and of the frames' own movements."""
        return float(self.squares.sum()) + self.noise_cost

    def covariance(self, path: SampledPath, distance: float, prior: FloatArray | float = 0.0) -> FloatArray:
        """The covariance (q, q) of y.

        distance: the rms displacement of the path, m, for one standard deviation along an unobserved direction;
        prior: information on y to add. Where it tells of all unobserved directions, they have its covariance.
        """
        added, own = np.zeros_like(self.matrix) + prior, self.rotation_size
        matrix, sizes = self.matrix + added, self.sizes + np.diag(added)
        null_space, known = null_space_of(matrix, sizes), symmetric_pseudo_inverse(matrix, sizes)
        of_prior = null_space.T @ added @ null_space
        if not null_space_of(of_prior).shape[1]:
            return np.asarray(known + null_space @ symmetric_pseudo_inverse(of_prior) @ null_space.T)
        lengths = path.lengths(null_space[own:])
        typical = path.lengths(np.diag(1 / np.sqrt(sizes[own:]))).max()
        moving = lengths > 1e-6 * typical  # the others change the rotation only
        spread = np.where(moving, distance / np.where(moving, lengths, 1.0), 0.0)
        return np.asarray(known + (null_space * spread**2) @ null_space.T)

    def offset_covariance(self, covariance: FloatArray, features: IntArray) -> tuple[FloatArray, FloatArray]:
        """Covariance (3, 3) of the offset of some features, and its cross-covariance (3, q) with y.

        The offset is that of the features' centroid from the centre of mass, in axes attached to them; covariance
        (q, q) is that of y.
        """
        attached = offset_by_points(self.points[features])
        by_y = attached @ self.by_unknowns.reshape(len(self.points), 3, -1)[features].reshape(3 * len(features), -1)
        alone = attached @ self.covariance_of_points(features) @ attached.T
        return np.asarray(alone + by_y @ covariance @ by_y.T), np.asarray(-by_y @ covariance)

    def covariance_of_points(self, features: IntArray) -> FloatArray:
        """The covariance (3 k, 3 k) of some points (k,) conditional on y."""
        if self.points_covariance.ndim == 3:
            return np.asarray(block_diag(*self.points_covariance[features]))
        columns = (3 * features[:, None] + np.arange(3)).ravel()
        return np.asarray(self.points_covariance[np.ix_(columns, columns)])


def equations(observations: Observations, model: Model) -> Equations:
    """The normal equations at a model."""
    m, q = observations.weight.shape[1], model.size
    sums = _Sums.zero(q, m, model.noise is not None)
    for part in _parts(observations, model):
        _add(sums, part, observations, model)
    inverse = _points_inverse(sums, model.noise is not None)
    if inverse.ndim == 3:
        by_unknowns = np.einsum("mij,qmj->miq", inverse, sums.coupling.reshape(q, m, 3)).reshape(3 * m, q)
        change = np.einsum("mij,mj->mi", inverse, sums.points_rhs)
    else:
        by_unknowns = inverse @ sums.coupling.T
        change = (inverse @ sums.points_rhs.ravel()).reshape(m, 3)
    sizes = np.diag(sums.matrix).copy()
    best = model.points + change
    squares, noise_cost = _squares(observations, replace(model, points=best))
    return Equations(
        matrix=sums.matrix - sums.coupling @ by_unknowns,
        rotation_size=model.rotation_size,
        sizes=sizes,
        rhs=sums.rhs - sums.coupling @ change.ravel(),
        points=best,
        squares=squares,
        noise_cost=noise_cost,
        points_covariance=inverse,
        by_unknowns=by_unknowns,
    )


@dataclass(eq=False)
class _Sums:
    """Sums over frames: of y, of y with the points, and of the points, dense (for frame noise) and their diagonal."""

    matrix: FloatArray
    rhs: FloatArray
    coupling: FloatArray
    subtracted: FloatArray
    point: FloatArray
    points_rhs: FloatArray

    @classmethod
    def zero(cls, q: int, m: int, dense: bool) -> "_Sums":
        """No frames, for q unknowns and m points."""
        subtracted = np.zeros((3 * m, 3 * m) if dense else (0, 0))
        return cls(
            np.zeros((q, q)), np.zeros(q), np.zeros((q, 3 * m)), subtracted, np.zeros((m, 3, 3)), np.zeros((m, 3))
        )


@dataclass(frozen=True, eq=False)
class _OfFrames:
    """The equations of n frames in their movements (φ, τ) in B, and what couples these with the points.

    turn, turn_shift, shift (n, 3, 3); turn_rhs, shift_rhs (n, 3); turn_points, shift_points (n, 3, 3 m), or None, where
    they are those of the blocks.
    """

    turn: FloatArray
    turn_shift: FloatArray
    shift: FloatArray
    turn_rhs: FloatArray
    shift_rhs: FloatArray
    turn_points: FloatArray | None = None
    shift_points: FloatArray | None = None

    @classmethod
    def of(cls, found: NormalBlocks, dense: bool) -> "_OfFrames":
        """Those of blocks; dense: with what couples with the points."""
        points = (found.turn_points(), found.shift_points()) if dense else (None, None)
        return cls(found.turn, found.turn_shift, found.shift, found.turn_rhs, found.shift_rhs, *points)


def _add(sums: _Sums, part: slice, observations: Observations, model: Model) -> None:
    """Add the frames of a part."""
    attitude, dense = model.attitude[part], model.knots is not None and observations.precision is not None
    found = normal_blocks(observations.frames(part), attitude, model.origin[part], model.points)
    sums.point += found.point
    sums.points_rhs += found.point_rhs
    if model.noise is None:
        frames = _OfFrames.of(found, dense)
    else:
        noise = model.noise.frames(part).of_poses(attitude, model.origin[part])
        frames = _under_noise(sums, found, noise)
    if model.knots is None:
        _add_every(sums, part, found, frames, model)
    else:
        _add_by_knots(sums, model.knots.around(part), found, frames, attitude)


def _under_noise(sums: _Sums, found: NormalBlocks, noise: FloatArray) -> _OfFrames:
    """The equations of frames that noise of a covariance (n, 6, 6) moves; adds what it takes from the points'."""
    (block, rhs), coupling = found.of_poses(), found.poses_points()
    size, gain = coupling.shape[2], _gain(block, noise)
    absorbed = gain @ coupling
    sums.subtracted += np.swapaxes(coupling, 0, 1).reshape(-1, size).T @ np.swapaxes(absorbed, 0, 1).reshape(-1, size)
    sums.points_rhs -= np.einsum("kip,ki->p", absorbed, rhs).reshape(-1, 3)
    coupling = coupling - block @ absorbed
    rhs = rhs - np.einsum("kij,kj->ki", block @ gain, rhs)
    block = block - block @ gain @ block
    corners = block[:, :3, :3], block[:, :3, 3:], block[:, 3:, 3:]
    return _OfFrames(*corners, rhs[:, :3], rhs[:, 3:], coupling[:, :3], coupling[:, 3:])


def _add_every(sums: _Sums, part: slice, found: NormalBlocks, frames: _OfFrames, model: Model) -> None:
    """Add the frames of a part by the Jacobians at every one of them."""
    turn, own = model.motion.turn_of(part), model.rotation_size
    R_B_C = np.swapaxes(model.attitude[part], 1, 2)
    shift = R_B_C @ model.path.jacobian[part]
    if model.path.turn is not None:
        half = 0.0 if model.turned is None else cross_matrices(model.turned[part]) / 2
        seen = R_B_C @ (np.eye(3) + half) @ model.path.turn[part]  # exp(θ + δ) = exp(δ + θ × δ/2 + …) exp(θ)
        turn = np.concatenate([turn, seen], axis=2)
    # Only the first of the unknowns turn the body, and only the last shift it.
    turning, shifting = slice(0, turn.shape[2]), slice(own, model.size)
    by_turn, by_shift = turn.reshape(-1, turn.shape[2]).T, shift.reshape(-1, shift.shape[2]).T
    crossed = by_turn @ (frames.turn_shift @ shift).reshape(-1, shift.shape[2])
    sums.matrix[turning, turning] += by_turn @ (frames.turn @ turn).reshape(-1, turn.shape[2])
    sums.matrix[turning, shifting] += crossed
    sums.matrix[shifting, turning] += crossed.T
    sums.matrix[shifting, shifting] += by_shift @ (frames.shift @ shift).reshape(-1, shift.shape[2])
    sums.rhs[turning] += by_turn @ frames.turn_rhs.ravel()
    sums.rhs[shifting] += by_shift @ frames.shift_rhs.ravel()
    if frames.turn_points is None or frames.shift_points is None:
        sums.coupling[turning] += found.unknowns_points(turn, np.zeros_like(turn))
        sums.coupling[shifting] += found.unknowns_points(None, shift)
    else:
        sums.coupling[turning] += by_turn @ frames.turn_points.reshape(by_turn.shape[1], -1)
        sums.coupling[shifting] += by_shift @ frames.shift_points.reshape(by_shift.shape[1], -1)


def _add_by_knots(
    sums: _Sums, around: KnotsAround, found: NormalBlocks, frames: _OfFrames, attitude: FloatArray
) -> None:
    """Add the frames of a part by the Jacobians at the knots around them."""
    R = np.asfortranarray(attitude)

    def in_C(own: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("kij,kjl->kil", R, own))

    blocks = frames.turn, frames.turn_shift, frames.shift
    of_turns, crossed, of_shifts = around.matrices(*(np.einsum("kil,kml->kim", in_C(own), R) for own in blocks))
    alone = in_C(np.stack([frames.turn_rhs, frames.shift_rhs], axis=2))
    if frames.turn_points is None or frames.shift_points is None:
        by_turn, by_shift = around.moments(np.concatenate([alone, found.in_other_axes(R)], axis=2))
        by_point = by_turn[:, 2:].reshape(len(by_turn), -1, 3)
        with_turn, with_shift = np.einsum("qmi,mij->qmj", by_point, found.arms), by_shift[:, 2:]
    else:
        coupling = in_C(frames.turn_points), in_C(frames.shift_points)
        by_turn, by_shift = around.moments(np.concatenate([alone, *coupling], axis=2))
        middle = 2 + coupling[0].shape[2]
        with_turn, with_shift = by_turn[:, 2:middle], by_shift[:, middle:]
    turning, shifting = slice(0, len(by_turn)), slice(len(by_turn), None)
    sums.matrix[turning, turning] += of_turns
    sums.matrix[turning, shifting] += crossed
    sums.matrix[shifting, turning] += crossed.T
    sums.matrix[shifting, shifting] += of_shifts
    sums.rhs[turning] += by_turn[:, 0]
    sums.rhs[shifting] += by_shift[:, 1]
    sums.coupling[turning] += with_turn.reshape(len(by_turn), -1)
    sums.coupling[shifting] += with_shift


def _gain(block: FloatArray, covariance: FloatArray) -> FloatArray:
    """(C⁻¹ + B)⁻¹ (n, 6, 6) for a covariance C that may be singular: C (1 + B C)⁻¹."""
    found = covariance @ np.linalg.inv(np.eye(6) + block @ covariance)
    return np.asarray((found + np.swapaxes(found, 1, 2)) / 2)


def _points_inverse(sums: _Sums, dense: bool) -> FloatArray:
    """The points' covariance conditional on y: (3 m, 3 m) if `dense`, else (m, 3, 3); zero for those never seen."""
    seen = np.trace(sums.point, axis1=1, axis2=2) > 0
    inverse = np.zeros_like(sums.point)
    if not dense:
        inverse[seen] = np.linalg.inv(sums.point[seen])
        return inverse
    rows = np.repeat(seen, 3)
    information = block_diag(*sums.point) - sums.subtracted
    found = np.zeros_like(information)
    found[np.ix_(rows, rows)] = np.linalg.inv(information[np.ix_(rows, rows)])
    return np.asarray(found)


def _squares(observations: Observations, model: Model) -> tuple[FloatArray, float]:
    """The weighted squared residuals (n, m), without the frames' own movements, and the cost of these."""
    squares, noise_cost = np.empty(observations.weight.shape), 0.0
    n, m = observations.weight.shape
    for part in _chunks(n, m, observations.precision is not None):
        attitude, own = model.attitude[part], observations.frames(part)
        residual = own.position - model.origin[part][:, None] - model.points @ np.swapaxes(attitude, 1, 2)
        if model.noise is not None:
            found = normal_blocks(own, attitude, model.origin[part], model.points)
            block, rhs = found.of_poses()
            gain = _gain(block, model.noise.frames(part).of_poses(attitude, model.origin[part]))
            moved = np.einsum("kij,kj->ki", gain, rhs)
            arms = np.cross(moved[:, None, :3], model.points) + moved[:, None, 3:]
            residual = residual - arms @ np.swapaxes(attitude, 1, 2)
            # νᵀ C⁻¹ ν with ν = (C⁻¹ + B)⁻¹ r: νᵀ (r − B ν).
            noise_cost += float(np.einsum("ki,ki->", moved, rhs - np.einsum("kij,kj->ki", block, moved)))
        squares[part] = own.weight * own.squares(residual)
    return squares, noise_cost


def _parts(observations: Observations, model: Model) -> list[slice]:
    """Chunks of frames that fit the processor's cache; with blocks, of whole ones."""
    n, m = observations.weight.shape
    if model.knots is None:
        starts = np.arange(0, n, max(64, CHUNK_SIZE // max(9 * m, 3 * model.size)))
    else:
        blocks = model.knots.blocks
        starts = np.arange(0, n, max(64, CHUNK_SIZE // max(9 * m, 3 * model.size * blocks.knots.size // n, PAIRS)))
        starts = np.unique(blocks.first[np.searchsorted(blocks.first, starts, side="right") - 1])
    return [slice(a, b) for a, b in pairwise([*starts.tolist(), n])]


def _chunks(n: int, m: int, full: bool) -> list[slice]:
    size = max(64, CHUNK_SIZE // ((9 if full else 3) * m))
    return [slice(first, first + size) for first in range(0, n, size)]
