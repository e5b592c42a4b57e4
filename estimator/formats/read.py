"""Tracks from a file, whose form its name tells."""

from pathlib import Path

import numpy as np

from baryscope.estimator.formats.c3d import read_c3d
from baryscope.estimator.formats.dataset import read_netcdf, read_zarr
from baryscope.estimator.formats.frame import tracks_of
from baryscope.estimator.formats.trc import read_trc
from baryscope.estimator.formats.units import Unit, in_metres
from baryscope.estimator.tables import FORM, read_table
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes

ENDINGS = (".csv", ".parquet", ".trc", ".c3d", ".nc", ".zarr")


def read_tracks(path: AnyPath, units: Unit | None = None) -> FeatureTracks:
    """Read tracks from a .csv, .parquet, .trc, .c3d or .nc file, or a .zarr folder.

    A Parquet file has the columns of the CSV file. The origin of C may be any point that does not accelerate, such as
    that of a laboratory.

    Args:
        path: the file.
        units: of its lengths; None: as the file says, and metres where its form has none.

    Raises:
        InputError: one line that names the file, what was found and what was expected; also for a covariance without a
            sound inverse.
    """
    source, ending = str(path), Path(path).suffix.lower()
    match ending:
        case ".csv":
            tracks, said = FeatureTracks.read_csv(path), "m"
        case ".parquet":
            tracks, said = _parquet(path), "m"
        case ".trc":
            tracks, said = read_trc(path)
        case ".c3d":
            tracks, said = read_c3d(path)
        case ".nc":
            tracks, said = read_netcdf(path, units)
        case ".zarr":
            tracks, said = read_zarr(path, units)
        case _:
            raise InputError(f"{source}: ends in {ending!r}, expected one of {', '.join(ENDINGS)}")
    if not (units or said):
        raise InputError(f"{source}: tells no unit of lengths, expected one to be told: --units mm, or another")
    tracks = in_metres(tracks, units or said, source)
    tracks.refuse_singular(lambda frame, feature: _place(tracks, frame, feature, source))
    return tracks


def _place(tracks: FeatureTracks, frame: int, feature: int, source: str) -> str:
    """The file of an observation, and its line if it is a CSV file."""
    if not source.lower().endswith(".csv"):
        return source
    table = read_table(read_bytes(source, FORM.what), source, FORM)
    there = (table.columns.numbers["time"] == tracks.time[frame]) & (table.columns.codes == feature)
    return table.place(int(np.argmax(there)))


def _parquet(path: AnyPath) -> FeatureTracks:
    import polars

    source = str(path)
    content = read_bytes(path, "feature tracks in Parquet")
    try:
        frame = polars.read_parquet(content)
    except polars.exceptions.PolarsError as error:
        raise InputError(f"{source}: not Parquet ({error})") from error
    return tracks_of(frame, source=source)
