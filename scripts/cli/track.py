"""`baryscope track`: tracks of features from the images of a stereo pair."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from baryscope import __version__
from baryscope.estimator.camera.rig import load_pair
from baryscope.estimator.formats import writable, write_tracks
from baryscope.estimator.images import Tracked, track
from baryscope.estimator.tables.times import read_times
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs
from baryscope.models.words import counted
from baryscope.progress import stage
from baryscope.scripts.cli.console import Show
from baryscope.scripts.cli.options.whole import Whole


def track_images(
    left: Path,
    right: Path,
    /,
    *,
    rig: Path,
    output: Annotated[Path, Parameter(alias="-o")],
    rate: float | None = None,
    times: Path | None = None,
    features: Whole = 60,
    show: Show | None = None,
) -> None:
    """Track features on a tumbling object through the images of a stereo pair, for `baryscope estimate --camera`.

    Needs OpenCV: pip install 'baryscope[images]'. The tracks are in the axes of the left camera, m, with a covariance
    of each observation.

    Parameters
    ----------
    left
        Images of the left camera: a folder (.png, .jpg, .tif, …, in the order of the numbers in their names) or a
        video.
    right
        Those of the right one, as many.
    rig
        The rig file, with the calibration of both cameras in [rig.left] and [rig.right].
    output
        The tracks: .csv, .parquet, .nc or .zarr.
    rate
        Pairs of images a second, those that are missing by the numbers in the names as well. Default: what the videos
        say.
    times
        A CSV file with the column time, in s or UTC, a row for each pair, instead of a rate.
    features
        Features that are followed at a time.
    """
    show = show or Show()
    path = writable(output)
    check_outputs([path], [left, right, rig, *([] if times is None else [times])])
    pair = load_pair(rig)
    if rate is not None and times is not None:
        raise InputError("--rate: found beside --times, expected one of them")
    moments, epoch = (rate, None) if times is None else read_times(times)
    with show.progress() as progress, stage(progress, "tracking") as share:
        found = track(left, right, pair, times=moments, epoch=epoch, most=features, progress=share)
    write_tracks(found.tracks, path)
    show.result(_values(found, path), *_words(found, path))


def _words(found: Tracked, path: Path) -> list[str]:
    """The result in a few lines."""
    seen = found.tracks.seen
    gaps = f"; by the numbers in the names {counted(found.missing, 'pair is', 'pairs are')} missing"
    return [
        f"{path}: {counted(int(seen.sum()), 'observation')} of {counted(seen.shape[1], 'feature')} in "
        f"{counted(len(seen), 'pair')} of images, {np.median(seen.sum(axis=1)):.0f} in a pair, "
        f"a feature for {np.median(seen.sum(axis=0)):.0f} pairs (medians)" + (gaps if found.missing else ""),
        f"a feature is placed to {found.pixel_noise:.3f} px; rows of left and right differ by "
        f"{found.row_offset:+.3f} px in the mean",
    ]


def _values(found: Tracked, path: Path) -> dict[str, object]:
    seen = found.tracks.seen
    return {
        "version": __version__,
        "tracks": str(path),
        "frames": seen.shape[0],
        "features": seen.shape[1],
        "observations": int(seen.sum()),
        "features_found": found.found,
        "pairs_missing": found.missing,
        "pixel_noise": found.pixel_noise,
        "row_offset": found.row_offset,
        "noise_ratio": found.noise_ratio,
    }
