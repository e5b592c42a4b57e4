"""Frames that a tracker has not measured: it lost the body, and repeats the last one that it saw.

So do recordings that are resampled to a higher rate without interpolation. Such frames agree to the last digit, as no
measured ones do. Their features seem to be known without noise, and the body to be at rest.
"""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tracks import FeatureTracks

NO_CHANCE = 1e-3  # of a repetition by rounding, over all frames
SHARE = 0.01  # of the frames, fewer of which do no harm


def held_frames(tracks: FeatureTracks) -> NDArray[np.bool_]:
    """Which frames (n,) repeat the one before that shows anything, every feature in every digit, as none by chance.

    The chance is that of rounding: how often each coordinate stays as it is from frame to frame while others change.
    So none is held where all frames are alike, as those of a body at rest in a simulation without noise.
    """
    held = np.zeros(len(tracks.time), dtype=bool)
    shown = np.nonzero(tracks.seen.any(axis=1))[0]
    every = slice(None) if len(shown) == len(held) else shown  # without a copy of all places
    seen, position = tracks.seen[every], tracks.position[every]
    alike = ((position[1:, :, 0] == position[:-1, :, 0]) == seen[1:]).all(axis=1) & (seen[1:] == seen[:-1]).all(axis=1)
    if not alike.any():
        return held
    stays = position[1:] == position[:-1]  # not where one of the two is not seen
    alike &= (stays.all(axis=2) | ~seen[1:]).all(axis=1)
    both = seen[1:] & seen[:-1]
    chance = (stays[~alike].sum(axis=0) + 1) / (both[~alike].sum(axis=0)[:, None] + 1)
    by_chance = np.where(both, chance.prod(axis=1), 1.0).prod(axis=1)
    held[shown[1:]] = alike & (len(alike) * by_chance < NO_CHANCE)
    return held if held.sum() >= SHARE * len(shown) else np.zeros_like(held)
