"""Jacobians of the true motion by central differences: by the chaser's state, the target's rate and its inertia."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.study.population.second.motion import relative_motion, tumbles
from baryscope.study.population.second.orbits import Elements

FloatArray = NDArray[np.float64]

STEP = 1.0  # m, and m times the orbit's mean motion
SMALL = 1e-6  # of the rate, and of the inertia's trace


@dataclass(frozen=True, eq=False)
class Start:
    """Where the motion begins. time: s; orbit: of the target; state (6,): chaser less target in I, m and m/s; inertia
    (3, 3) about the CoM; rate (3,) in B, rad/s; quaternion (w, x, y, z) of R_I_B.
    """

    time: float
    orbit: Elements
    state: FloatArray
    inertia: FloatArray
    rate: FloatArray
    quaternion: FloatArray


def path_jacobian(start: Start, times: FloatArray) -> FloatArray:
    """(n, 3, 6): of the CoM in C, which is the target less the chaser in axes of I, by the chaser's state."""
    scale = np.repeat([STEP, STEP * start.orbit.n], 3)

    def path(change: FloatArray) -> FloatArray:
        return -relative_motion(start.orbit, start.time, start.state + change, times)[:, :3]

    columns = [(path(change) - path(-change)) / (2 * change.sum()) for change in np.diag(scale)]
    return np.stack(columns, axis=2)


def turn(start: Start, times: FloatArray) -> FloatArray:
    """(n, 3, 8): rotation vectors in B by the rate, and by five parameters of a symmetric inertia over its trace."""
    size, trace = float(np.linalg.norm(start.rate)), float(np.trace(start.inertia))
    basis = np.zeros((5, 3, 3))
    for k, (i, j) in enumerate([(0, 1), (0, 2), (1, 2)]):
        basis[k, i, j] = basis[k, j, i] = 1.0
    basis[3], basis[4] = np.diag([1.0, -1.0, 0.0]), np.diag([0.0, 1.0, -1.0])
    none, still = np.zeros((3, 3)), np.zeros(3)
    changes = [(none, SMALL * size * axis, SMALL * size) for axis in np.eye(3)]
    changes += [(SMALL * trace * part, still, SMALL) for part in basis]

    inertias, rates = np.array([inertia for inertia, _, _ in changes]), np.array([rate for _, rate, _ in changes])
    own = start.inertia + np.concatenate([inertias, -inertias]), start.rate + np.concatenate([rates, -rates])
    after, before = np.split(tumbles(*own, start.quaternion, start.time, times), 2)
    turns = np.swapaxes(before, 2, 3) @ after
    columns = [
        Rotation.from_matrix(one).as_rotvec() / (2 * step) for one, (_, _, step) in zip(turns, changes, strict=True)
    ]
    return np.stack(columns, axis=2)
