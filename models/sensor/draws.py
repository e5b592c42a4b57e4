"""Random numbers by counter, the same in the campaign and in the unit StereoRig.

Philox4x64-10 (Salmon, Moraes, Dror, Shaw, SC 2011) makes four numbers from a key and a counter. The key is the seed and
the purpose, the counter the frame, from 1, and the feature: a draw depends on nothing else, neither on the order in
which draws are made nor on the number of frames and features.
"""

from enum import IntEnum
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.columns import ColumnFunction
from baryscope.models.frames import Symbol

FloatArray = NDArray[np.float64]


class Purpose(IntEnum):
    """What a draw is for.

    NOISE: of pixels or positions. FATE: whether an observation is dropped (first number) or a blunder (second).
    BLUNDER: its error. ATTITUDE: noise of the camera's attitude, of feature 0.
    """

    NOISE = 0
    FATE = 1
    BLUNDER = 2
    ATTITUDE = 3


def uniforms(seed: int, purpose: Purpose, shape: tuple[int, int]) -> FloatArray:
    """Four uniform numbers between 0 and 1, neither included, for every frame and feature: (n, m, 4).

    Args:
        seed: below 2**64.
        purpose: what they are for.
        shape: (n, m), frames and features.
    """
    frames, features = shape
    bits = np.empty((frames, features, 4), dtype=np.uint64)
    for feature in range(features):  # NumPy's Philox counts up before the first draw: to frame 1
        source = np.random.Philox(key=(purpose << 64) + seed, counter=feature << 64)
        bits[:, feature] = source.random_raw(4 * frames).reshape(frames, 4)
    return ((bits >> np.uint64(12)).astype(np.float64) + 0.5) * 2.0**-52


def standard_normals(seed: int, purpose: Purpose, shape: tuple[int, int]) -> FloatArray:
    """Three independent standard normal numbers for every frame and feature: (n, m, 3)."""
    return _normals()(uniforms(seed, purpose, shape).reshape(-1, 4).T).reshape(*shape, 3)


@cache
def _normals() -> ColumnFunction:
    u = ca.SX.sym("u", 4)
    return ColumnFunction("normals", [u], normals_of(u))


def normals_of(u: Symbol) -> Symbol:
    """Three independent standard normal numbers of four uniform ones (Box, Muller 1958), without rejection."""
    length = [ca.sqrt(-2 * ca.log(u[k])) for k in (0, 2)]
    angle = [2 * ca.pi * u[k] for k in (1, 3)]
    return ca.vertcat(length[0] * ca.cos(angle[0]), length[0] * ca.sin(angle[0]), length[1] * ca.cos(angle[1]))
