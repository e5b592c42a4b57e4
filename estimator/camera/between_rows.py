"""The attitude of a camera between the rows of its table: a cubic in time through rotation vectors from the row before.

A camera that swings does not turn evenly from row to row. Along the great circle between two rows, h s apart, its
attitude is off by up to |dω/dt| h²/8, the same in every turn of the swing: half a milliradian for 3° in a minute and
rows every 3 s, which no residual shows beside a path. Rows on either side tell dω/dt, and how it changes.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import matrix_from_quaternion
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

# Over the interval, how far off a row on either side is. Nearer ones would amplify noise: at half of it the row has a
# third of the weight in the middle, at a quarter more than those beside. Farther ones tell of other swings.
NEAREST, FARTHEST = 0.5, 2.0
WIDEST = float(np.deg2rad(20.0))  # to such a row: a wider turn is another manoeuvre


def interpolated(time: FloatArray, quaternion: FloatArray, left: IntArray, moments: FloatArray) -> FloatArray:
    """The rotations (n, 3, 3) at moments (n,) in s after the rows left (n,), none of which is the last, and before the
    next ones.

    time (k,) in s, ascending; quaternion (k, 4), (w, x, y, z), the rows' rotations. An even turn is followed exactly.
    """
    begin, interval, since = time[left], time[left + 1] - time[left], moments - time[left]
    origin = matrix_from_quaternion(quaternion[left])
    turn = _turn(origin, quaternion[left + 1])
    rows = (
        np.searchsorted(time, begin - NEAREST * interval, side="right") - 1,
        np.searchsorted(time, begin + (1 + NEAREST) * interval, side="left"),
    )
    bends, at, told = [], [], []
    for row in rows:
        there = np.clip(row, 0, len(time) - 1)
        apart = time[there] - begin
        beyond = np.maximum(-apart, apart - interval)
        own = _turn(origin, quaternion[there])
        near = (row == there) & (beyond >= NEAREST * interval) & (beyond <= FARTHEST * interval)
        near &= np.linalg.norm(own, axis=1) <= WIDEST
        apart = np.where(near, apart, -interval)  # of one that is not used, any time that is no row's
        # Newton's divided difference of the row before, the one after and this one
        bend = (own / apart[:, None] - turn / interval[:, None]) / (apart - interval)[:, None]
        bends.append(np.where(near[:, None], bend, 0.0))
        at.append(apart)
        told.append(near)
    both, span = told[0] & told[1], np.where(told[0] & told[1], at[1] - at[0], 1.0)
    share = np.where(both, (since - at[0]) / span, np.where(told[0], 0.0, 1.0))[:, None]
    bend = (1 - share) * bends[0] + share * bends[1]
    moved = (since / interval)[:, None] * turn + (since * (since - interval))[:, None] * bend
    return np.asarray(origin @ exp_rotation(moved))


def _turn(origin: FloatArray, quaternion: FloatArray) -> FloatArray:
    """The rotation vectors (n, 3) from rotations (n, 3, 3) to those of quaternions (n, 4)."""
    return log_rotation(np.swapaxes(origin, 1, 2) @ matrix_from_quaternion(quaternion))
