"""The free tumbles of many bodies at once, from one epoch: members of a posterior, far away from the tracks."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.euler import rate_columns, step_columns
from baryscope.estimator.dynamics.rotation import Rotation, motion_between
from baryscope.estimator.geometry.alignment import quaternion_from_matrix

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

AT_ONCE = 200_000  # nodes of all bodies together: a hundred megabytes
COARSER = 2.0  # times as far from node to node as elsewhere: members need no more than 1e-5 rad


def motions(bodies: Sequence[Rotation], time: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Attitudes (m, n, 3, 3) R_C_B and rates (m, n, 3) of m bodies at times (n,) in s on one side of their epoch.

    That, and the orbit whose gravity turns them, is the same for all, and no further torque acts. Bodies whose nodes
    may be nearly as far apart are integrated together. Also (m,), whether each could be followed.
    """
    m, far = len(bodies), float(time[np.argmax(np.abs(time - bodies[0].epoch))] - bodies[0].epoch)
    R, rate, followed = np.full((m, len(time), 3, 3), np.nan), np.full((m, len(time), 3), np.nan), np.zeros(m, bool)
    steps = np.array([abs(far) / one.longest_step / COARSER if one.reaches(time) else np.nan for one in bodies])
    alike = np.ceil(np.log2(np.maximum(steps, 1.0)))
    for one in np.unique(alike[np.isfinite(steps)]):
        group = np.flatnonzero(alike == one)
        nodes = int(np.ceil(max(steps[group].max(), 1.0)))
        for some in np.array_split(group, np.ceil(len(group) * (nodes + 1) / AT_ONCE)):
            R[some], rate[some] = _followed([bodies[k] for k in some], nodes, far, time)
            followed[some] = np.isfinite(R[some]).all(axis=(1, 2, 3))
    return R, rate, followed


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
