"""Blocks of time in which the Jacobians of rotation and path are cubics: four times of a block stand for many frames.

The sum over frames Σ Jᵀ B J, with Jacobians J (6, q) that are cubics in a block, is a sum over blocks: of the frames'
6 × 6 matrices B only the sums with products of the cubics' weights are needed. So the cost of q² is that of the blocks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.paths import Path
from baryscope.estimator.dynamics.rotation import Rotation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

KNOTS = 4  # times of a block, Chebyshev's: the error of a wave is 5e-6 of it for each (ωT)⁴, T the block's length
WORTHWHILE = 2 * KNOTS  # frames of a block, on average, from which sums over blocks are faster


@dataclass(frozen=True, eq=False)
class Blocks:
    """k blocks of n frames: the first frame (k,) of each, and its times (k, KNOTS) in s.

    weights (n, KNOTS): the value of a cubic at a frame is the sum of these times its values at the times of the block.
    """

    first: IntArray
    time: FloatArray
    weights: FloatArray


def blocks_of(time: FloatArray, longest: float) -> Blocks | None:
    """Blocks of at most `longest` seconds of ascending times (n,) in s; None if they would have few frames."""
    span = float(time[-1] - time[0])
    count = max(int(np.ceil(span / longest)), 1) if longest > 0 else len(time)
    if span <= 0 or len(time) < WORTHWHILE * count:
        return None
    length = span / count
    index = np.minimum(((time - time[0]) / length).astype(np.intp), count - 1)
    first = np.nonzero(np.diff(index, prepend=-1))[0]
    nodes = -np.cos(np.pi * (np.arange(KNOTS) + 0.5) / KNOTS)
    middle = time[0] + (index[first] + 0.5) * length
    own = (time - (time[0] + (index + 0.5) * length)) / (length / 2)
    others = nodes[None, :] + np.diag(np.full(KNOTS, np.nan))
    weights = np.nanprod((own[:, None, None] - others) / (nodes[:, None] - others), axis=2)
    return Blocks(first, middle[:, None] + length / 2 * nodes, weights)


@dataclass(frozen=True, eq=False)
class Knots:
    """The Jacobians (k, KNOTS, 6, q) at the times of blocks: of rotations and shifts in C by the unknowns."""

    blocks: Blocks
    moves: FloatArray

    @classmethod
    def of(cls, blocks: Blocks, rotation: Rotation, path: Path) -> "Knots":
        """Those of a rotation and a path."""
        time = blocks.time.ravel()
        motion, shift = rotation.at(time), path.at(time).jacobian
        turn = motion.attitude @ motion.turn
        moves = np.zeros((len(time), 6, turn.shape[2] + shift.shape[2]))
        moves[:, :3, : turn.shape[2]] = turn
        moves[:, 3:, turn.shape[2] :] = shift
        return cls(blocks, moves.reshape(*blocks.time.shape, 6, -1))

    def sums(
        self, part: slice, attitude: FloatArray, matrix: FloatArray, rhs: FloatArray, coupling: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Σ Jᵀ B J (q, q), Σ Jᵀ r (q,) and Σ Jᵀ D (q, p) over the frames of a part, which has whole blocks.

        attitude (n, 3, 3) R_C_B; matrix B (n, 6, 6), rhs r (n, 6) and coupling D (n, 6, p), all in B.
        """
        begin, end = np.searchsorted(self.blocks.first, [part.start, part.stop])
        starts, weights = self.blocks.first[begin:end] - part.start, self.blocks.weights[part]
        in_C = np.concatenate([matrix, rhs[:, :, None], coupling], axis=2)
        in_C[:, :3], in_C[:, 3:] = attitude @ in_C[:, :3], attitude @ in_C[:, 3:]
        R_B_C = np.swapaxes(attitude, 1, 2)
        in_C[:, :, :3], in_C[:, :, 3:6] = in_C[:, :, :3] @ R_B_C, in_C[:, :, 3:6] @ R_B_C
        n, blocks = len(in_C), end - begin
        flat = in_C.reshape(n, -1)
        single = np.stack([np.add.reduceat(flat * weights[:, i, None], starts) for i in range(KNOTS)], axis=1)
        single = single.reshape(blocks, KNOTS, 6, -1)[..., 6:]
        pairs = np.empty((blocks, KNOTS, 6, KNOTS, 6))
        own = np.ascontiguousarray(in_C[:, :, :6]).reshape(n, 36)
        for i in range(KNOTS):
            for j in range(i + 1):
                product = (weights[:, i] * weights[:, j])[:, None]
                pairs[:, i, :, j] = np.add.reduceat(own * product, starts).reshape(blocks, 6, 6)
                pairs[:, j, :, i] = pairs[:, i, :, j]
        moves = self.moves[begin:end].reshape(blocks, 6 * KNOTS, -1)
        q = moves.shape[2]
        jacobian = moves.reshape(-1, q)
        total = jacobian.T @ (pairs.reshape(blocks, 6 * KNOTS, 6 * KNOTS) @ moves).reshape(-1, q)
        others = jacobian.T @ single.reshape(len(jacobian), -1)
        return total, others[:, 0], others[:, 1:]
