"""The Cramér–Rao bound where errors of features last: all observations are whitened along time.

Errors of a first-order Markov process of deviation σ that keeps the share a from one frame to the next are white after
e_k → (e_k − a e_{k−1}) / √(1 − a²), along the axes in which they are such a process. What the unknowns do goes the same
way, so that frames no longer stand by themselves: free attitudes stay among the unknowns.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from baryscope.study.population.information import cross_of
from baryscope.study.world.scenes import Scene, memory

FloatArray = NDArray[np.float64]

FAR = 1e3  # m or rad, deviation of a weak prior, which holds the orientation of the body's axes


def lasting_bound(made: Scene, turn: FloatArray | None) -> FloatArray:
    """The bound (p, p) of the covariance of the path's unknowns, where all features are seen in all frames.

    turn (n, 3, t): rotation vectors in B by the unknowns of the tumble; None leaves the attitudes free.
    """
    n, m, p = len(made.time), len(made.points), made.jacobian.shape[2]
    to_errors = made.attitude if made.world.error_axes == "camera" else np.tile(np.eye(3), (n, 1, 1))
    by_path = np.repeat(to_errors @ np.swapaxes(made.attitude, 1, 2) @ made.jacobian, m, axis=0)
    by_points = sparse.vstack([sparse.kron(sparse.eye_array(m), one) for one in to_errors])
    arms = to_errors[:, None] @ cross_of(-made.points)
    by_turn = sparse.block_diag(list(arms.reshape(n, 3 * m, 3)))
    if turn is not None:
        by_turn = by_turn @ sparse.csr_array(turn.reshape(3 * n, -1))
    jacobian = sparse.hstack([sparse.csr_array(by_path.reshape(3 * n * m, p)), by_points, by_turn])
    keep = memory(made.time, made.world.error_time)
    along = sparse.eye_array(n) + sparse.diags_array(-keep, offsets=-1)
    along = sparse.diags_array(1 / np.sqrt(1 - np.append(0.0, keep) ** 2)) @ along
    white = (sparse.kron(along, sparse.eye_array(3 * m)) @ jacobian).tocsr() / made.world.noise
    information = (white.T @ white).toarray() + FAR**-2.0 * np.eye(jacobian.shape[1])
    scale = 1 / np.sqrt(np.diag(information))
    of_path = np.linalg.solve(information * scale * scale[:, None], np.eye(len(scale))[:, :p])[:p]
    return np.asarray(of_path * scale[:p] * scale[:p, None])
