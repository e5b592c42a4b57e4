"""Attitudes that leave the rotation and still fit: two swapped labels can turn a shape over, for a frame or a while.

In a turned run of frames, the axes of the body are all off by the same rotation: one jump begins it, one ends it. Two
features by themselves are turned over by any exchange of their labels, and are as far apart as before.
"""

from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

SMALLEST = 1.0  # rad off the rotation between the frames before and after, at least, of a flip
LIMIT = 6.0  # times the median of all frames
MAX_STEP = 4  # typical ones to the frame before or after, at most
ROUNDS = 5  # of the search: some flips show once others are left out
STEPS = 3  # before a jump, and after it, that show the rotation there
SAME = 0.8  # rad between two turns of the axes that count as one
ALONE = 1 / 3  # of a jump: other steps nearby are off by less
ALONG = float(np.cos(np.pi / 6))  # of what a line turns by from frame to frame at most, where its ends are followed
MOST_UNLIKE, MOST_REVERSED = 0.1, 0.4  # of such steps turn by more, and reverse, where they still are


def steady(time: FloatArray, attitude: FloatArray) -> BoolArray:
    """Which attitudes (n, 3, 3) lie on one steady rotation, (n,); time (n,) in typical steps of the frames.

    Nothing is found where the rotation from frame to frame is not steady, or too fast to be followed.
    """
    kept = np.ones(len(time), dtype=bool)
    for _ in range(ROUNDS):
        index = np.nonzero(kept)[0]
        if len(index) < 2 * STEPS or not _has_jumps(attitude[index]):
            break
        bad = _turned_runs(time[index], attitude[index])
        if not bad.any():
            bad = _flips(time[index], attitude[index])
        if not bad.any():
            break
        kept[index[bad]] = False
    return kept


def same_sense(time: FloatArray, along: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Which directions (n, 3) of a line point the way that most around them do, (n,), and which have such around them.

    time (n,) in typical steps of the frames. Where a line cannot be followed from frame to frame all are taken to be
    right, and none is sure.
    """
    cosine, near = np.einsum("ki,ki->k", along[:-1], along[1:]), np.diff(time) <= MAX_STEP
    followed = near & (np.abs(cosine) > ALONG)
    kept, sure = np.ones(len(time), dtype=bool), np.zeros(len(time), dtype=bool)
    count = int(followed.sum())
    if count < (1 - MOST_UNLIKE) * near.sum() or (followed & (cosine < 0)).sum() > MOST_REVERSED * count:
        return kept, sure
    edges = np.concatenate([[0], np.nonzero(~followed)[0] + 1, [len(time)]])
    for begin, end in pairwise(edges):
        sense = np.cumprod(np.concatenate([[1.0], np.sign(cosine[begin : end - 1])]))
        kept[begin:end] = sense * sense.sum() >= 0
        sure[begin:end] = end - begin >= STEPS
    return kept, sure


def _has_jumps(attitude: FloatArray) -> bool:
    """Whether some rotation from frame to frame is far from the typical one: a quick test."""
    cosine = (np.einsum("kij,kij->k", attitude[:-1], attitude[1:]) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return bool((np.abs(angle - np.median(angle)) > SMALLEST / 2).any())


def _flips(time: FloatArray, attitude: FloatArray) -> BoolArray:
    """The attitudes farthest off the rotation between their neighbours, (n,)."""
    gap = time[2:] - time[:-2]
    near = gap <= 2 * MAX_STEP
    share = (time[1:-1] - time[:-2]) / gap
    before, after = attitude[:-2], attitude[2:]
    expected = before @ exp_rotation(share[:, None] * log_rotation(np.swapaxes(before, 1, 2) @ after))
    off = np.linalg.norm(log_rotation(np.swapaxes(expected, 1, 2) @ attitude[1:-1]), axis=1)
    if not near.any():
        return np.zeros(len(time), dtype=bool)
    padded = np.pad(np.where(near, off, 0.0), 2)
    farthest = padded[2:-2] >= np.maximum(padded[1:-3], padded[3:-1])
    found = near & farthest & (off > max(SMALLEST, LIMIT * float(np.median(off[near]))))
    return np.pad(found, 1)


def _turned_runs(time: FloatArray, attitude: FloatArray) -> BoolArray:
    """The attitudes whose axes are turned against those of most frames of the same chain, (n,).

    A chain ends where no frame is within MAX_STEP, as the rotation is not followed any farther.
    """
    gap = np.diff(time)
    step = log_rotation(np.swapaxes(attitude[:-1], 1, 2) @ attitude[1:])
    # Windows of the steps before and after each; those that the tracks' ends cut short begin or end there.
    index, last = np.arange(len(gap)), len(gap) - STEPS
    before, after = np.clip(index - STEPS, 0, last), np.clip(index + 1, 0, last)
    rate = np.median(sliding_window_view(step / gap[:, None], STEPS, axis=0), axis=2)
    turn = exp_rotation(-rate[before] * gap[:, None]) @ exp_rotation(step)
    size = np.linalg.norm(log_rotation(turn), axis=1)
    typical = float(np.median(size))
    # A turn of the axes turns the rate in them, and no other step nearby is off: else it is a poor attitude.
    same = np.linalg.norm((turn @ rate[after][:, :, None])[:, :, 0] - rate[before], axis=1) * gap < max(
        SAME, LIMIT * typical
    )
    nearby = sliding_window_view(np.pad(size, STEPS), 2 * STEPS + 1, axis=0).copy()
    nearby[:, STEPS] = 0.0
    alone = nearby.max(axis=1) < size * ALONE
    follows = gap <= MAX_STEP
    jump = follows & same & alone & (size > max(SMALLEST, LIMIT * typical))
    turned = np.zeros(len(time), dtype=bool)
    edges = np.concatenate([[0], np.nonzero(~follows)[0] + 1, [len(time)]])
    for begin, end in pairwise(edges):
        jumps = begin + np.nonzero(jump[begin : end - 1])[0]
        if len(jumps):
            turned[begin:end] = _minority(np.diff(np.concatenate([[begin], jumps + 1, [end]])), turn[jumps])
    return turned


def _minority(lengths: IntArray, turns: FloatArray) -> BoolArray:
    """The frames of runs of k + 1 lengths that are not in the most frequent axes, for the turns (k, 3, 3) between."""
    axes = [np.eye(3)]
    for turn in turns:
        axes.append(axes[-1] @ turn)
    between = np.einsum("aij,bij->ab", axes, axes)
    alike = between > 1 + 2 * np.cos(SAME)
    most = int(np.argmax(alike @ lengths))
    return np.repeat(~alike[most], lengths)
