"""The sums over frames that make the joint normal equations, by the Jacobians of every frame or of knots."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, NormalBlocks, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.ml.jacobians import KnotsAround
from baryscope.estimator.ml.model import FrameNoise, Model
from baryscope.estimator.paths.blocks import PAIRS

FloatArray = NDArray[np.float64]


@dataclass(eq=False)
class Sums:
    """The normal equations of the q unknowns y and of m points in B, before the points are eliminated.

    matrix (q, q), rhs (q,) of y; coupling (q, 3 m) of y with the points; point (m, 3, 3), points_rhs (m, 3): each
    point's own; subtracted (3 m, 3 m): what noise of whole frames takes from those of all points, (0, 0) without it.
    """

    matrix: FloatArray
    rhs: FloatArray
    coupling: FloatArray
    subtracted: FloatArray
    point: FloatArray
    points_rhs: FloatArray

    @classmethod
    def of(cls, observations: Observations, model: Model) -> "Sums":
        """The sums over all frames, at a model."""
        sums = cls._zero(model.size, observations.weight.shape[1], model.noise is not None)
        for part in _parts(observations, model):
            _add(sums, part, observations, model)
        return sums

    @classmethod
    def _zero(cls, q: int, m: int, dense: bool) -> "Sums":
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
        """The terms of frames with normal blocks; dense: with what couples with the points."""
        points = (found.turn_points(), found.shift_points()) if dense else (None, None)
        return cls(found.turn, found.turn_shift, found.shift, found.turn_rhs, found.shift_rhs, *points)


def _add(sums: Sums, part: slice, observations: Observations, model: Model) -> None:
    """Add the frames of a part."""
    attitude, dense = model.attitude[part], model.knots is not None and observations.precision is not None
    found = normal_blocks(observations.frames(part), attitude, model.origin[part], model.points)
    sums.point += found.point
    sums.points_rhs += found.point_rhs
    if model.noise is None:
        frames = _OfFrames.of(found, dense)
    else:
        frames = _under_noise(sums, found, model.noise.frames(part), attitude, model.origin[part])
    if model.knots is None:
        _add_every(sums, part, found, frames, model)
    else:
        _add_by_knots(sums, model.knots.around(part), found, frames, attitude)


def _under_noise(
    sums: Sums, found: NormalBlocks, noise: FrameNoise, attitude: FloatArray, origin: FloatArray
) -> _OfFrames:
    """The equations of frames, of these poses, that noise moves; adds what it takes from the points'."""
    (block, rhs), coupling = found.of_poses(), found.poses_points()
    size, gain = coupling.shape[2], noise.gain(block, attitude, origin)
    absorbed = gain @ coupling
    sums.subtracted += np.swapaxes(coupling, 0, 1).reshape(-1, size).T @ np.swapaxes(absorbed, 0, 1).reshape(-1, size)
    sums.points_rhs -= np.einsum("kip,ki->p", absorbed, rhs).reshape(-1, 3)
    coupling = coupling - block @ absorbed
    rhs = rhs - np.einsum("kij,kj->ki", block @ gain, rhs)
    block = block - block @ gain @ block
    corners = block[:, :3, :3], block[:, :3, 3:], block[:, 3:, 3:]
    return _OfFrames(*corners, rhs[:, :3], rhs[:, 3:], coupling[:, :3], coupling[:, 3:])


def _add_every(sums: Sums, part: slice, found: NormalBlocks, frames: _OfFrames, model: Model) -> None:
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
    sums: Sums, around: KnotsAround, found: NormalBlocks, frames: _OfFrames, attitude: FloatArray
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
