"""The free tumbles of many bodies at once, from one epoch: members of a posterior, far away from the tracks.

Their steps are long. What these do wrong to the body in their middle, whose exact motion is known, they do nearly alike
to all that turn about as fast, and it is taken from these.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.euler import rate_columns, step_columns
from baryscope.estimator.dynamics.rotation import Attitudes, Rotation, motion_between
from baryscope.estimator.geometry.alignment import quaternion_from_matrix

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

AT_ONCE = 200_000  # nodes of all bodies together: a hundred megabytes
COARSER = 2.0  # times as far from node to node as elsewhere: members need no more than 1e-5 rad


def motions(bodies: Sequence[Rotation], middle: Rotation, known: Attitudes) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Attitudes (m, n, 3, 3) R_C_B and rates (m, n, 3) of m bodies at the times (n,) of `known`, which are on one side
    of their epoch.

    That, and the orbit whose gravity turns them, is the same for all, and no further torque acts. Bodies whose nodes
    may be nearly as far apart are integrated together. Also (m,), whether each could be followed.

    Args:
        bodies: m of them.
        middle: the body about which they are.
        known: its motion.
    """
    time = known.time
    m, far = len(bodies), float(time[np.argmax(np.abs(time - bodies[0].epoch))] - bodies[0].epoch)
    R, rate, followed = np.full((m, len(time), 3, 3), np.nan), np.full((m, len(time), 3), np.nan), np.zeros(m, bool)
    every = [*bodies, middle]
    steps = np.array([abs(far) / one.longest_step / COARSER if one.reaches(time) else np.nan for one in every])
    steps, of_middle = np.maximum(steps[:-1], 1.0), max(float(steps[-1]), 1.0)
    alike = np.round(np.log2(steps / of_middle))
    for one in np.unique(alike[np.isfinite(steps)]):
        group = np.flatnonzero(alike == one)
        nodes = int(np.ceil(max(steps[group].max(), of_middle if one == 0 else 1.0)))
        for some in np.array_split(group, np.ceil(len(group) * (nodes + 1) / AT_ONCE)):
            found = _followed([*(bodies[k] for k in some), middle], nodes, far, time)
            if one == 0:
                found = _mended(*found, known)
            R[some], rate[some] = (values[: len(some)] for values in found)
            followed[some] = np.isfinite(R[some]).all(axis=(1, 2, 3))
    return R, rate, followed


def _mended(R: FloatArray, rate: FloatArray, known: Attitudes) -> tuple[FloatArray, FloatArray]:
    """Attitudes (m, n, 3, 3) and rates (m, n, 3) without what is wrong with those of the last body, which are known."""
    return R @ (np.swapaxes(R[-1], 1, 2) @ known.attitude), rate + (known.rate - rate[-1])


@np.errstate(over="ignore", invalid="ignore")
def _followed(bodies: Sequence[Rotation], count: int, far: float, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Attitudes (m, n, 3, 3) and rates (m, n, 3) by `count` steps, together `far` s; not finite if they diverge."""
    first, tilted = bodies[0], bodies[0].orbit is not None
    h = far / count if far else 1e-9
    constants = np.array([one.constants for one in bodies]).T
    states = np.empty((count + 1, len(bodies), 8))
    states[0, :, :4] = quaternion_from_matrix(np.array([one.attitude for one in bodies]))
    states[0, :, 4:7] = [one.rate for one in bodies]
    states[0, :, 7] = first.true_anomaly(np.array([first.epoch]))
    step = step_columns(tilted)
    for before, after in pairwise(states):
        after[:] = step(before.T, np.array([h]), constants)
    states[..., :4] /= np.linalg.norm(states[..., :4], axis=2, keepdims=True)
    everywhere = np.broadcast_to(constants[:, None], (len(constants), *states.shape[:2])).reshape(len(constants), -1)
    rates = rate_columns(tilted)(states.reshape(-1, 8).T, everywhere)[:, 4:7]
    nodes = first.epoch + h * np.arange(count + 1.0)
    R, rate = motion_between(nodes, states[..., :7], rates.reshape(*states.shape[:2], 3), time)
    return np.moveaxis(R, 0, 1), np.moveaxis(rate, 0, 1)
