"""Tracks that are well formed but cannot be what they say: the likely cause, before an estimator fails at them."""

import numpy as np

from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

LARGEST = 2000.0  # m, the width of a body; what is wider was probably measured in millimetres
SAMPLE = 200  # frames looked at for the width


def refuse_implausible(tracks: FeatureTracks, source: str) -> None:
    """Check that features share times and labels, and are as close together as those of one body; `source` names them.

    Raises:
        InputError: they do not, with the likely cause.
    """
    seen = tracks.seen
    observations, times = int(seen.sum()), seen.any(axis=1).sum()
    features = seen.any(axis=0).sum()
    if features == observations > 3 and times > 1:
        raise InputError(
            f"{source}: {features} labels in {observations} observations, a new one in each, "
            "expected the same label wherever a feature is seen again"
        )
    if times == observations and features > 2:
        raise InputError(
            f"{source}: no two of the {features} features have a time in common, a time stamp for each feature?, "
            "expected one time for all features of a frame"
        )
    width = _width(tracks)
    if not width <= LARGEST:  # or too large for a number
        raise InputError(f"{source}: features about {width:.0f} m apart, in millimetres?, expected metres and one body")


def _width(tracks: FeatureTracks) -> float:
    """Roughly how far apart the features of a frame are, m; hardly moved by some that are wrong. 0 if unknown."""
    shared = np.nonzero(tracks.seen.sum(axis=1) > 1)[0]
    if not shared.size:
        return 0.0
    frames = shared[np.unique(np.linspace(0, len(shared) - 1, SAMPLE).astype(np.intp))]
    with np.errstate(over="ignore", invalid="ignore"):
        position = tracks.position[frames]
        off = np.abs(position - np.nanmedian(position, axis=1, keepdims=True)).max(axis=2)
        return 2 * float(np.median(np.nanmedian(off, axis=1)))
