"""The normal equations of a path and a body's points, after the elimination of the body's rotation in every frame.

A frame has the blocks T of its rotation φ, U of φ with the shift τ, and those of each point: w [b]× with φ and w with τ
for observations of the same weight w along all axes. With H = T⁻¹ and Q = Uᵀ H, what is left of τ is s − Q U with the
sum s of the weights, of τ with a point w (1 − Q [b]×), and of two points −w w' [b]×ᵀ H [b']×. So sums over frames of
w A (1 − Q [b]×), with A the attitude, and of w w' H suffice, without the points' blocks in each frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.adjustment.frame_shifts import FrameShifts, shifts_in
from baryscope.estimator.adjustment.normal_equations import CHUNK_SIZE, at_best_attitudes, normal_blocks
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.indices import IntArray, as_slice, block_of
from baryscope.estimator.geometry.so3 import cross_matrices, exp_rotation
from baryscope.estimator.geometry.symmetric import FULL, elements_of, inverted_sums, symmetric_inverses
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.estimator.registration.body import Body

FloatArray = NDArray[np.float64]

SPARSE = 0.75  # share of a body's features, of which fewer that are seen are taken alone


@dataclass(eq=False)
class ReducedEquations:
    """Normal equations of one body after the elimination of its rotations: of the path (p, p) and of points (3 m, 3 m).

    path_points (p, 3 m) couples them; sizes: diagonals before the elimination; right-hand sides; noise_cost: the
    weighted squares of the frames' own shifts, and noise_volume: ln det (1 + N Σ) of these, N their information and Σ
    their covariance, summed over the frames: what their freedom costs.
    """

    path: FloatArray
    path_points: FloatArray
    points: FloatArray
    path_sizes: FloatArray
    points_sizes: FloatArray
    path_rhs: FloatArray
    points_rhs: FloatArray
    noise_cost: float = 0.0
    noise_volume: float = 0.0

    @classmethod
    def zero(cls, p: int, q: int) -> "ReducedEquations":
        """No frames."""
        return cls(
            np.zeros((p, p)), np.zeros((p, q)), np.zeros((q, q)), np.zeros(p), np.zeros(q), np.zeros(p), np.zeros(q)
        )

    def add(self, other: "ReducedEquations", features: IntArray) -> None:
        """Add the equations of the same path from other frames, in which k features of the body are seen, by index."""
        columns = (3 * features[:, None] + np.arange(3)).ravel()
        own = as_slice(columns)
        self.path += other.path
        self.path_points[:, own] += other.path_points
        self.points[block_of(columns, columns)] += other.points
        self.path_sizes += other.path_sizes
        self.points_sizes[own] += other.points_sizes
        self.path_rhs += other.path_rhs
        self.points_rhs[own] += other.points_rhs
        self.noise_cost += other.noise_cost
        self.noise_volume += other.noise_volume

    def know(self, information: FloatArray, by_points: FloatArray, offset: FloatArray) -> None:
        """Add a prior of mean zero on a function of the points, an offset (3,) with the Jacobian A (3, 3 m).

        information (3 m, 3): Aᵀ P for the information P of the prior.
        """
        added = information @ by_points
        self.points += added
        self.points_sizes += np.diag(added)
        self.points_rhs -= information @ offset

    def eliminate(self, rows: FloatArray, solved: FloatArray) -> None:
        """Subtract from the points' equations what other unknowns of n frames take, three of each.

        rows (3 + 3 m + 1, 3, n): their blocks with the frames' shifts and the points, and right-hand sides; solved: by
        their own blocks.
        """
        size = len(rows) - 3
        outer = rows[3:].reshape(size, -1) @ solved[3:].reshape(size, -1).T
        self.points -= outer[:-1, :-1]
        self.points_rhs -= outer[:-1, -1]


@dataclass(frozen=True, eq=False)
class AllFrames:
    """Of all n frames: the path there, its origin (n, 3) in C, and their shifts."""

    path: SampledPath
    origin: FloatArray
    shifts: FrameShifts | None


# The best attitudes (k, 3, 3), the equations and the weighted squares (k, m)
Reduced: TypeAlias = tuple[FloatArray, ReducedEquations, FloatArray]


def eliminated(body: Body, own: Observations, frames: AllFrames) -> tuple[Body, ReducedEquations, FloatArray]:
    """The body with the best attitudes for its points, its normal equations there, and the weighted squares (k, m).

    own: observations of its features in all frames.
    """
    reduced = _with_weights if own.precision is None and frames.shifts is None else _with_blocks
    n, m = len(body.frames), len(body.features)
    attitude, squares = np.empty_like(body.attitude), np.zeros((n, m))
    total = ReducedEquations.zero(frames.path.size, 3 * m)
    for part in chunks_of(body):
        some, features = body.in_frames(part), np.arange(m)
        here = own.frames(some.frames)
        seen = np.any(here.weight > 0, axis=0)
        if seen.sum() < SPARSE * m:  # under new names whenever they come back, few of many are seen at a time
            features = np.flatnonzero(seen)
            some, here = some.of_features(seen), here.features(features)
        attitude[part], found, squares[part, as_slice(features)] = reduced(some, here, frames)
        total.add(found, features)
    return replace(body, attitude=attitude), total, squares


def chunks_of(body: Body) -> Iterator[slice]:
    """Slices of a body's frames whose arrays fit the cache."""
    size = max(64, CHUNK_SIZE // (6 * len(body.features)))
    return (slice(first, first + size) for first in range(0, len(body.frames), size))


def _with_weights(body: Body, own: Observations, frames: AllFrames) -> Reduced:
    """The elimination for observations of the same weight along all axes, without shifts."""
    path, m, index, arms = frames.path, len(body.features), as_slice(body.frames), cross_matrices(body.points)
    attitude, found = at_best_attitudes(own, body.attitude, frames.origin[index], body.points)
    # With the frames last in memory, as the blocks have them.
    w, R = np.asfortranarray(own.weight), np.asfortranarray(attitude)
    inverse, back = symmetric_inverses(found.turn), np.einsum("kij,klj->kil", R, found.turn_shift)
    gain = np.einsum("kij,kjl->kil", back, inverse)
    left = found.shift - np.einsum("kij,klj->kil", gain, back)
    rhs = np.einsum("kij,kj->ki", R, found.shift_rhs) - np.einsum("kij,kj->ki", gain, found.turn_rhs)
    of_path, path_sizes = path.gram_and_diagonal(index, left, found.shift)
    by_path, across = path.moment(index, _coupling(w, R, gain, arms)), w.T
    pairs = across @ (across[:, :, None] * elements_of(inverse))
    turned = across @ np.einsum("kij,kj->ki", inverse, found.turn_rhs)
    points_sizes = np.repeat(w.sum(axis=0), 3)
    of_pairs = np.swapaxes(arms, 1, 2)[:, None] @ pairs[:, :, FULL] @ arms
    sums = ReducedEquations(
        path=of_path,
        path_points=np.moveaxis(by_path, 0, 1).reshape(-1, 3 * m),
        points=np.diag(points_sizes) - of_pairs.transpose(0, 2, 1, 3).reshape(3 * m, 3 * m),
        path_sizes=path_sizes,
        points_sizes=points_sizes,
        path_rhs=path.moment(index, rhs[:, :, None])[:, 0],
        points_rhs=(found.point_rhs + (arms @ turned[:, :, None])[:, :, 0]).ravel(),
    )
    return attitude, sums, found.squares


def _coupling(weight: FloatArray, attitude: FloatArray, gain: FloatArray, arms: FloatArray) -> FloatArray:
    """The blocks w (A − A Q [b]×) (m, n, 3, 3) of the shift in C with each point, for gain A Q (n, 3, 3)."""
    n, m = weight.shape
    # [b]×ᵀ (A Q)ᵀ of all points and frames in one multiplication, with the frames last.
    turned = (np.swapaxes(arms, 1, 2).reshape(3 * m, 3) @ gain.T.reshape(3, 3 * n)).reshape(m, 3, 3, n)
    coupling = np.subtract(attitude.transpose(1, 2, 0), turned.swapaxes(1, 2), order="C")
    coupling *= weight.T[:, None, None]
    return np.asarray(coupling.transpose(0, 3, 1, 2))


def _with_blocks(body: Body, own: Observations, frames: AllFrames) -> Reduced:
    """The elimination for observations with precisions, or frames with shifts: these by Woodbury's formula."""
    path, index = frames.path, as_slice(body.frames)
    origin, shifts = frames.origin[index], shifts_in(frames.shifts, index)
    sums = ReducedEquations.zero(path.size, 3 * len(body.features))
    attitude, found = at_best_attitudes(own, body.attitude, origin, body.points, shifts)
    sums.points_sizes = np.diagonal(found.point, axis1=1, axis2=2).ravel()
    sums.points_rhs = found.point_rhs.ravel()
    sums.points = block_diag(*found.point)
    # Three rows of each frame: by its shift τ, by the points, and the right-hand side. Eliminate its rotation.
    coupling = _rows(found.turn_shift, found.turn_points(), found.turn_rhs)
    inverse = symmetric_inverses(found.turn)
    solved = np.einsum("kij,qjk->qik", inverse, coupling)
    sums.eliminate(coupling, solved)
    rows = _rows(found.shift, found.shift_points(), found.shift_rhs)
    rows -= np.einsum("kji,qjk->qik", found.turn_shift, solved)
    squares = found.squares
    if shifts is not None:
        known, rhs = rows[:3].transpose(2, 1, 0), rows[-1].T
        gained = np.einsum("kij,qjk->qik", inverted_sums(shifts.among_all(attitude), known), rows)
        sums.eliminate(rows, gained)
        covariance = shifts.in_body(attitude)
        sums.noise_volume = float(np.linalg.slogdet(np.eye(3) + covariance @ known)[1].sum())
        moved = np.einsum("kij,kj->ki", inverted_sums(covariance, known), rhs)
        cost = float(np.vdot(moved, rhs - np.einsum("kij,kj->ki", known, moved)))
        sums.noise_cost = max(cost, 0.0)  # squares, if it were not for rounding
        turned = solved[-1].T - np.einsum("kil,klj,kj->ki", inverse, found.turn_shift, moved, optimize=True)
        there = origin + np.einsum("kij,kj->ki", attitude, moved)
        squares = normal_blocks(own, attitude @ exp_rotation(turned), there, body.points).squares
        rows = rows - np.einsum("kij,qjk->qik", known, gained)
    rows = np.einsum("kij,qjk->qik", np.asfortranarray(attitude), rows)
    R_B_C = np.swapaxes(attitude, 1, 2)
    left = rows[:3].transpose(2, 1, 0) @ R_B_C
    sums.path, sums.path_sizes = path.gram_and_diagonal(index, left, attitude @ found.shift @ R_B_C)
    moments = path.moment(index, rows[3:].transpose(2, 1, 0))
    sums.path_points, sums.path_rhs = moments[:, :-1], moments[:, -1]
    return attitude, sums, squares


def _rows(by_shift: FloatArray, by_points: FloatArray, rhs: FloatArray) -> FloatArray:
    """Three rows of each of n frames, (3 + 3 m + 1, 3, n): by the shift (n, 3, 3), the points (n, 3, 3 m), and (n, 3).

    With the frames last in memory, so that sums run along them.
    """
    return np.concatenate([by_shift.T, by_points.T, rhs.T[None]])
