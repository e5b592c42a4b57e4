"""Checks of well-formed tracks for likely mistakes in labels, times and units, before an estimator fails."""

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.limits import NARROWEST
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]

LARGEST = 2000.0  # m, the width of a body; wider ones are probably given in millimetres
LONG = 10_000.0  # s: nothing is recorded for hours where no orbit bends its way; ten seconds in milliseconds are
MARKS = 3  # observations at a place on the diagonal, which are no chance
SERIES = 3  # rows of an attitude, and frames, from which on all between two are too many
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


def doubted_mark(tracks: FeatureTracks) -> str | None:
    """What to say of observations whose coordinates are all one number, as -9999, in a line: a mark for not seen.

    None of features that are nowhere else.
    """
    position = tracks.position
    alike = (position[..., 0] == position[..., 1]) & (position[..., 1] == position[..., 2])
    alike &= (tracks.seen & ~alike).any(axis=0)
    values, counts = np.unique(position[alike, 0], return_counts=True)
    if not len(values) or counts.max() < MARKS:
        return None
    mark = float(values[np.argmax(counts)])
    features = (alike & (position[..., 0] == mark)).any(axis=0).sum()
    return (
        f"x, y and z are {mark:g} in {counts.max()} observations of {counted(int(features), 'feature')}: "
        "a mark for what is not seen? Such rows are to be left out, or empty"
    )


def doubted_log(acceleration: KnownAcceleration, times: FloatArray) -> str | None:
    """What to say of a log that tells of no acceleration at times (n,), s, in a line: it is likely of another unit."""
    begin, end = float(times.min()), float(times.max())
    if acceleration.time[0] > end:
        where = f"its first row is at {acceleration.time[0]:.10g} s, after {end:.10g} s, the last time in question"
    elif acceleration.time[-1] <= begin and not acceleration.value[-1].any():
        where = f"its last row is at {acceleration.time[-1]:.10g} s, before {begin:.10g} s, the first time in question"
    else:
        return None
    return f"{where}: it changes nothing; times in milliseconds, or with another zero?"


def doubted_attitude(attitude: AttitudeSeries, times: FloatArray) -> str | None:
    """What to say of an attitude of more than two rows if all times (n,), s, are between two of them, in a line.

    None of one whose times are UTC.
    """
    if attitude.epoch is not None or len(attitude.time) < SERIES or len(times) < SERIES:
        return None
    before = int(np.searchsorted(attitude.time, times.min(), side="right"))
    if before in (0, len(attitude.time)) or times.max() > attitude.time[before]:
        return None
    between = f"{attitude.time[before - 1]:.10g} and {attitude.time[before]:.10g} s"
    return (
        f"all times of the tracks are between two of its rows, {between}: times in milliseconds? Seconds are expected"
    )


def width_of(tracks: FeatureTracks) -> float | None:
    """A robust estimate of the extent of the features in a frame, m; None if no frame has two features."""
    shared = np.nonzero(tracks.seen.sum(axis=1) > 1)[0]
    if not shared.size:
        return None
    frames = shared[evenly_spaced(len(shared), SAMPLE)]
    position = tracks.position[frames]
    off = np.abs(position - np.nanmedian(position, axis=1, keepdims=True)).max(axis=2)
    return 2 * float(np.median(np.nanmedian(off, axis=1)))
