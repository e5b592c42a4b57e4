"""Checks of well-formed tracks for likely mistakes in labels, times and units, before an estimator fails."""

import numpy as np

from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.limits import NARROWEST
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError

LARGEST = 2000.0  # m, the width of a body; wider ones are probably given in millimetres
LONG = 10_000.0  # s: nothing is recorded for hours where no orbit bends its way; ten seconds in milliseconds are
SAMPLE = 200  # frames examined for the width


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
    width = width_of(tracks)
    if width is not None and width > LARGEST:
        raise InputError(
            f"{source}: features about {width:.0f} m apart, in millimetres? (--units mm), expected metres and one body"
        )
    if width is not None and width < NARROWEST:
        raise InputError(
            f"{source}: features about {width:.2g} m apart, all in one place?, "
            f"expected metres and a body of at least {NARROWEST:g} m"
        )


def doubted_times(tracks: FeatureTracks) -> str | None:
    """What to say of a recording of hours without an orbit, in a line: it is likely one of seconds in milliseconds.

    None of one whose times are UTC, or which is shorter without its gaps.
    """
    lasts = float(tracks.time[-1] - tracks.time[0])
    if tracks.epoch is not None or lasts <= LONG:
        return None
    steps = np.diff(tracks.time)
    step = float(np.median(steps))
    if step * len(steps) <= LONG:
        return None
    return f"it lasts {lasts:.0f} s, a frame every {step:g} s: times in milliseconds? Seconds are expected"


def width_of(tracks: FeatureTracks) -> float | None:
    """A robust estimate of the extent of the features in a frame, m; None if no frame has two features."""
    shared = np.nonzero(tracks.seen.sum(axis=1) > 1)[0]
    if not shared.size:
        return None
    frames = shared[evenly_spaced(len(shared), SAMPLE)]
    position = tracks.position[frames]
    off = np.abs(position - np.nanmedian(position, axis=1, keepdims=True)).max(axis=2)
    return 2 * float(np.median(np.nanmedian(off, axis=1)))
