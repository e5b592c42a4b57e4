"""Tracks of features from the images of a stereo pair, with covariances that the images themselves tell."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.estimator.camera.pair import CameraPair
from baryscope.estimator.images.frames import Folder, Video, frames_of, pairs_of
from baryscope.estimator.images.rectify import Rectified
from baryscope.estimator.images.tracker import MOST, Sightings, Tracker
from baryscope.estimator.progress import Progress
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.ephemeris.utc import Utc
from baryscope.models.errors import ComputationError, InputError, Reason
from baryscope.models.files import AnyPath
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]

LEAST = 8  # sightings of a feature that is kept: what is lost at once is often no point of the body
FEWEST, MANY = 8, 1000  # features at a time that may be asked for
SAME_RATE = 1e-3  # by which the rates that two videos tell may differ


@dataclass(frozen=True, eq=False)
class Tracked:
    """Tracks from images, and what they are worth.

    Attributes:
        tracks: in the left camera's axes, from its place; with covariances.
        pixel_noise: rms error of a coordinate of a feature in an image, px: that of the rows of left and right, which
            should be the same, over √2.
        row_offset: their mean difference, px: what the calibration leaves.
        noise_ratio: that error over the one which the pixels' own noise would make; the covariances have it.
        found: number of features that were found, of which those with fewer than LEAST sightings are not in the tracks.
        missing: pairs that are missing by the numbers in the images' names, and count where a rate tells the times.
    """

    tracks: FeatureTracks
    pixel_noise: float
    row_offset: float
    noise_ratio: float
    found: int
    missing: int = 0


def track(
    left: AnyPath,
    right: AnyPath,
    pair: CameraPair,
    *,
    times: float | ArrayLike | None = None,
    epoch: Utc | None = None,
    most: int = MOST,
    progress: Progress | None = None,
) -> Tracked:
    """Track features through the images of two folders or videos.

    Args:
        left: folder of images, or video, of the left camera.
        right: that of the right one; images of one place in the order are of one time.
        pair: the cameras.
        times: (n,), s, of each pair; or how many there are a second, from time 0 on: by default as the videos say.
            Where numbers are missing in the images' names, so are pairs.
        epoch: UTC of time 0, as text in ISO 8601 or as datetime, if it is known.
        most: features at a time.
        progress: told the share that is done.

    Raises:
        InputError: one line that says where, what was found, what was expected.
        ComputationError: no feature is seen for long enough.
    """
    if not FEWEST <= most <= MANY:
        raise InputError(f"features: found {most}, expected {FEWEST} to {MANY} at a time")
    sides = frames_of(left), frames_of(right)
    given = _times(*sides, times)
    tracker = Tracker(Rectified.of(pair), most)
    seen: list[Sightings] = []
    for images in _expected(sides, pair.left.resolution, len(given) if given.ndim else None):
        seen.append(tracker.sightings(*images))
        if progress is not None and len(sides[0]):
            progress(len(seen) / len(sides[0]))
    places = sides[0].places(len(seen))
    missing = 0 if given.ndim else int(places[-1]) + 1 - len(seen)
    found = _tracked(given if given.ndim else places / given, seen, epoch, missing)
    if found is None:
        raise ComputationError(_why_none(tracker, len(seen)), Reason.TOO_FEW_FEATURES)
    return found


def _why_none(tracker: Tracker, pairs: int) -> str:
    """How far the corners of the images have come, of which none is in the tracks."""
    rows = f", {np.median(tracker.rows):+.0f} px from their rows in the median" if tracker.rows else ""
    return (
        f"no feature is seen {LEAST} times in {counted(pairs, 'pair')} of images: of "
        f"{counted(tracker.corners, 'corner')} in the left ones, the right ones show {len(tracker.rows)}{rows}, and "
        f"{tracker.numbered} were placed well enough to be followed"
    )


def _times(left: Folder | Video, right: Folder | Video, times: float | ArrayLike | None) -> FloatArray:
    """The times (n,) that are given, or the rate ()."""
    if times is None:
        if left.rate is None:
            raise InputError(f"{left.path}: does not tell the images' times, expected a rate or times")
        if right.rate is not None and abs(right.rate - left.rate) > SAME_RATE * left.rate:
            raise InputError(
                f"{right.path}: found {right.rate:g} images a second, expected {left.rate:g} as in {left.path}"
            )
        times = left.rate
    given = np.asarray(times, dtype=np.float64)
    if given.ndim == 0 and not (np.isfinite(given) and given > 0):
        raise InputError(f"rate: found {float(given):g} Hz, expected a number above 0")
    return given


def _expected(
    sides: tuple[Folder | Video, Folder | Video], resolution: tuple[int, int], count: int | None
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    """The pairs of images, as many as there are times, if these are given."""
    number = 0
    for images in pairs_of(*sides, resolution):
        number += 1
        if count is not None and number > count:
            raise InputError(f"{sides[0].path}: more than {counted(count, 'image')}, expected one for each time")
        yield images
    if count is not None and number < count:
        raise InputError(f"{sides[0].path}: {counted(number, 'image')}, expected {count}, one for each time")


def _tracked(time: FloatArray, seen: Sequence[Sightings], epoch: Utc | None, missing: int) -> Tracked | None:
    """The sightings of all frames as tracks, with covariances as large as the rows' differences tell; None if no
    feature is seen for long enough.
    """
    numbers, sightings = np.unique(np.concatenate([frame.numbers for frame in seen]), return_counts=True)
    kept = numbers[sightings >= LEAST]
    if not len(kept):
        return None
    rows = np.concatenate([frame.parallax for frame in seen])
    deviations = np.concatenate([frame.deviation for frame in seen])
    ratio = float(np.sqrt(np.mean((rows / deviations) ** 2)))
    position = np.full((len(seen), len(kept), 3), np.nan)
    covariance = np.full((len(seen), len(kept), 3, 3), np.nan)
    for k, frame in enumerate(seen):
        own = np.isin(frame.numbers, kept)
        column = np.searchsorted(kept, frame.numbers[own])
        position[k, column], covariance[k, column] = frame.position[own], ratio**2 * frame.covariance[own]
    tracks = FeatureTracks(time, position, [f"F{number + 1}" for number in kept.tolist()], covariance, epoch)
    noise = float(np.sqrt(np.mean(rows**2) / 2))
    return Tracked(tracks, noise, float(rows.mean()), ratio, len(numbers), missing)
