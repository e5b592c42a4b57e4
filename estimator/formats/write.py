"""Tracks and estimates into files, whose form their names tell."""

from collections.abc import Mapping
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from baryscope.estimator.formats.c3d_write import c3d_bytes
from baryscope.estimator.formats.dataset import dataset_of_tracks, xarray_for
from baryscope.estimator.formats.markers import MARKER_FORMS, with_marker
from baryscope.estimator.formats.trc import refuse_unfit, write_trc
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, Folder, Whole, Writer, write_together

if TYPE_CHECKING:
    from xarray import Dataset

WRITABLE = (".csv", ".parquet", ".nc", ".zarr")
ENGINES = {".nc": "h5netcdf", ".zarr": "zarr"}


def writable(path: AnyPath, forms: tuple[str, ...] = WRITABLE) -> Path:
    """A path whose ending tells of a form that can be written, one of `forms`: by default those with covariances.

    Raises:
        InputError: it does not, or what xarray needs for .nc or .zarr is missing.
    """
    ending = Path(path).suffix
    if ending not in forms:
        raise InputError(f"{path}: ends in {ending!r}, expected {', '.join(forms[:-1])} or {forms[-1]}")
    if ending in ENGINES:
        xarray_for(str(path), ENGINES[ending])
    return Path(path)


def write_tracks(tracks: FeatureTracks, path: AnyPath) -> None:
    """Write tracks as a .csv, .parquet, .nc, .trc or .c3d file or a .zarr folder, so that `read_tracks` restores them.

    Raises:
        InputError: another ending, what xarray needs for .nc or .zarr is missing, .trc or .c3d have no place for
            something that they have, as covariances, or the file cannot be written.
        DiskError: the disk is full, or fails.
    """
    write_together({Path(path): writer_of_tracks(tracks, path)})


def writer_of_tracks(tracks: FeatureTracks, path: AnyPath) -> Writer:
    """What writes the file of `write_tracks`.

    Raises:
        InputError: another ending, or what xarray needs for .nc or .zarr is missing, or .trc or .c3d cannot hold them.
    """
    match writable(path, (*WRITABLE, *MARKER_FORMS)).suffix:
        case ".parquet":
            return parquet(tracks.columns())
        case ".nc":
            return netcdf(dataset_of_tracks(tracks))
        case ".zarr":
            return zarr(dataset_of_tracks(tracks))
        case ".trc":
            refuse_unfit(tracks, str(path))
            return partial(write_trc, tracks, Path(path).name)
        case ".c3d":
            content = c3d_bytes(tracks, str(path))
            return Whole(lambda place: place.write_bytes(content))
    return tracks.write_rows


def refuse_unmarkable(tracks: FeatureTracks, path: Path) -> None:
    """Check that a recording can be written with a centre as one more marker, before that is found: in .trc or .c3d.

    Raises:
        InputError: it has a marker of the file's name, or the form cannot hold it.
    """
    nowhere = with_marker(tracks, path.stem, tracks.time[:0], tracks.position[:0, 0], str(path))
    writer_of_tracks(nowhere, path)


def parquet(columns: Mapping[str, Any]) -> Whole:
    """What writes columns of equal lengths as Parquet."""
    import polars

    return Whole(polars.DataFrame(columns).write_parquet)


def netcdf(dataset: "Dataset") -> Whole:
    """What writes a dataset as NetCDF 4: made in memory, as HDF5 leaves the process in ruins where a disk is full."""

    def write(path: Path) -> None:
        import h5netcdf
        from xarray.backends import H5NetCDFStore

        content = BytesIO()
        with h5netcdf.File(content, "w") as file:
            dataset.dump_to_store(H5NetCDFStore(file))
        path.write_bytes(content.getbuffer())

    return Whole(write)


def zarr(dataset: "Dataset") -> Folder:
    """What writes a dataset as a Zarr store of format 2, which any reader of Zarr knows."""
    return Folder(
        lambda path: dataset.to_zarr(path, zarr_format=2, consolidated=True, mode="w"),
        "a Zarr store",
        (".zgroup", "zarr.json"),
    )
