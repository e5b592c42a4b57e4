"""Attitudes that leave the rotation for a single frame: two swapped labels can turn a triangle over and still fit."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

SMALLEST = 1.0  # rad off the rotation between the frames before and after, at least, of a flip
LIMIT = 6.0  # times the median of all frames
MAX_STEP = 4  # frames to the one before or after, at most
ROUNDS = 5


def steady(frames: IntArray, attitude: FloatArray) -> BoolArray:
    """Which attitudes (n, 3, 3) in the frames (n,) lie on the rotation between the one before and the one after, (n,).

    Nothing is found where the rotation from frame to frame is not steady, or too fast to be followed.
    """
    kept = np.ones(len(frames), dtype=bool)
    for _ in range(ROUNDS):
        index = np.nonzero(kept)[0]
        if len(index) < 5 or not _has_jumps(attitude[index]):
            break
        bad = _flips(frames[index], attitude[index])
        if not bad.any():
            break
        kept[index[bad]] = False
    return kept


def _has_jumps(attitude: FloatArray) -> bool:
    """Whether some rotation from frame to frame is far from the typical one: a quick test."""
    cosine = (np.einsum("kij,kij->k", attitude[:-1], attitude[1:]) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return bool((np.abs(angle - np.median(angle)) > SMALLEST / 2).any())


def _flips(frames: IntArray, attitude: FloatArray) -> BoolArray:
    """The attitudes farthest off the rotation between their neighbours, (n,)."""
    gap = frames[2:] - frames[:-2]
    near = gap <= 2 * MAX_STEP
    share = (frames[1:-1] - frames[:-2]) / gap
    before, after = attitude[:-2], attitude[2:]
    expected = before @ exp_rotation(share[:, None] * log_rotation(np.swapaxes(before, 1, 2) @ after))
    off = np.linalg.norm(log_rotation(np.swapaxes(expected, 1, 2) @ attitude[1:-1]), axis=1)
    if not near.any():
        return np.zeros(len(frames), dtype=bool)
    padded = np.pad(np.where(near, off, 0.0), 2)
    farthest = padded[2:-2] >= np.maximum(padded[1:-3], padded[3:-1])
    found = near & farthest & (off > max(SMALLEST, LIMIT * float(np.median(off[near]))))
    return np.pad(found, 1)
