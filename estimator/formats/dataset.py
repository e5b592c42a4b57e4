"""Tracks and estimates as datasets of xarray, by the CF conventions; tracks in NetCDF files and Zarr stores."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.formats.cf_times import seconds_of_cf
from baryscope.estimator.formats.times import seconds_of
from baryscope.estimator.formats.units import Unit, in_metres, in_square_of
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.ephemeris.utc import utc_text
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, read_bytes

if TYPE_CHECKING:
    from xarray import Dataset

AXES = ["x", "y", "z"]
CONVENTIONS = "CF-1.12"
CLASSIC = (b"CDF\1", b"CDF\2")  # NetCDF 3, which xarray writes where neither h5netcdf nor netCDF4 is installed


def dataset_of_tracks(tracks: FeatureTracks) -> "Dataset":
    """The tracks with dimensions time, feature and axis, NaN for what is not seen; covariance has `axis_` besides.

    Raises:
        InputError: xarray is not installed.
    """
    values: dict[str, Any] = {
        "position": (("time", "feature", "axis"), tracks.position, {"units": "m", "long_name": "of the feature"})
    }
    if tracks.covariance is not None:
        about = {"units": "m2", "long_name": "of the position"}
        values["covariance"] = (("time", "feature", "axis", "axis_"), tracks.covariance, about)
    title = "tracks of features in frame C: origin at the chaser, inertial axes"
    return dataset(tracks.time, tracks.epoch, values, title, {"feature": list(tracks.labels)})


def dataset(
    time: Any, epoch: str | None, values: dict[str, Any], title: str, others: dict[str, Any] | None = None
) -> "Dataset":
    """A dataset over time in s, or since an epoch in UTC, with the axes x, y, z of C where it has them.

    Raises:
        InputError: xarray is not installed.
    """
    xarray = xarray_for("a dataset")
    units = "s" if epoch is None else f"seconds since {epoch.removesuffix('Z')}"
    of_time = {"units": units, "standard_name": "time", "axis": "T"}
    axes = {name: AXES for name in ("axis", "axis_") if any(name in of[0] for of in values.values())}
    found: Dataset = xarray.Dataset(
        {name: (dims, np.array(given), about) for name, (dims, given, about) in values.items()},
        coords={"time": ("time", time, of_time)} | (others or {}) | axes,
        attrs={"Conventions": CONVENTIONS, "title": title},
    )
    return found


def tracks_of_dataset(found: "Dataset", *, units: Unit | None = None, source: str = "dataset") -> FeatureTracks:
    """Tracks from a dataset as `dataset_of_tracks` makes it; times may be datetimes or durations.

    Args:
        found: with `position(time, feature, axis)`, and optionally `covariance(time, feature, axis, axis_)`.
        units: of the positions; None: what their attribute `units` says, and metres without one. Covariances may be in
            the square of another, which theirs says.
        source: names the dataset in errors.

    Raises:
        InputError: it has no such positions, or its numbers are no tracks.
    """
    return in_metres(*_measured(found, units, source), source)


def _measured(found: "Dataset", units: Unit | None, source: str) -> tuple[FeatureTracks, str]:
    """Tracks, in the unit of length of its positions, and that unit; covariances may be in the square of another.

    units: of the positions, whatever they say.

    Raises:
        InputError: it has no `position` with the dimensions time, feature and axis, or its numbers are no tracks.
    """
    if "position" not in found or set(found["position"].dims) != {"time", "feature", "axis"}:
        dims = found["position"].dims if "position" in found else "no variable of that name"
        raise InputError(f"{source}, position: {dims}, expected the dimensions time, feature and axis")
    for name in ("axis", "axis_"):
        found = _in_order(found, name, source)
    position = found["position"].transpose("time", "feature", "axis")
    said, covariance = position.attrs.get("units"), None
    unit = str(units or said or "m")
    if "covariance" in found:
        given = found["covariance"].transpose("time", "feature", "axis", "axis_")
        told = str(given.attrs.get("units", f"{unit}2"))
        denied = None if units is None or said is None else str(said)
        covariance = in_square_of(given.values, unit, told, f"{source}, covariance", denied)
    time, epoch = _times(found, source)
    try:
        labels = _words(found["feature"].values)
        tracks = FeatureTracks(time, position.values, labels, covariance, epoch)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    return tracks, unit


def _in_order(found: "Dataset", dimension: str, source: str) -> "Dataset":
    """The dataset with x, y and z in this order along a dimension; without labels, they are.

    Raises:
        InputError: it has other labels.
    """
    if dimension not in found.coords:
        return found
    labels = _words(found[dimension].values)
    if sorted(labels) != AXES:
        raise InputError(f"{source}, {dimension}: found {', '.join(labels)}, expected {', '.join(AXES)}")
    return found.isel({dimension: [labels.index(axis) for axis in AXES]})


def _words(values: NDArray[Any]) -> list[str]:
    """Labels as text: bytes are those of a variable of characters, as NetCDF 3, MATLAB and Fortran have them."""
    return [label.decode(errors="replace") if isinstance(label, bytes) else str(label) for label in values]


def _times(found: "Dataset", source: str) -> tuple[Any, str | None]:
    """Times (n,) in s, and the UTC of time 0 if it is known.

    Raises:
        InputError: there are none, or in another unit.
    """
    if "time" not in found.variables:
        raise InputError(f"{source}, time: no variable of that name, expected the times of the frames")
    time = found["time"]
    moments = seconds_of(time.values, lambda frame: f"{source}, time of frame {frame}")
    if moments is not None:  # xarray has decoded them
        seconds, first = moments
        return seconds, None if first is None else utc_text(first)
    return seconds_of_cf(time.values, time.attrs, f"{source}, time")


def read_netcdf(path: AnyPath, units: Unit | None = None) -> tuple[FeatureTracks, str]:
    """The tracks of a NetCDF file, in its unit of length, and that unit; units: what it is, whatever the file says.

    Raises:
        InputError: it is no such file, or xarray or h5netcdf is not installed.
    """
    source = str(path)
    classic = read_bytes(path, "feature tracks in NetCDF").startswith(CLASSIC)
    xarray = xarray_for(source)
    try:
        with xarray.open_dataset(path, engine="scipy" if classic else "h5netcdf", decode_times=False) as opened:
            found = opened.load()
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise InputError(f"{source}: not NetCDF ({error})") from error
    return _measured(found, units, source)


def read_zarr(path: AnyPath, units: Unit | None = None) -> tuple[FeatureTracks, str]:
    """The tracks of a Zarr store, a folder, in its unit of length, and that unit; units: as of `read_netcdf`.

    Raises:
        InputError: it is no such folder, or xarray or zarr is not installed.
    """
    source = str(path)
    if not Path(path).is_dir():
        raise InputError(f"{source}: no such folder, expected feature tracks in Zarr")
    xarray = xarray_for(source, "zarr")
    try:
        with xarray.open_dataset(path, engine="zarr", decode_times=False, chunks=None) as opened:
            found = opened.load()
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        why = str(error.args[0] if error.args else error)  # without the quotes that a KeyError puts around it
        raise InputError(f"{source}: not Zarr ({why})") from error
    return _measured(found, units, source)


def xarray_for(what: str, engine: str = "h5netcdf") -> Any:
    """The module, for what needs it and another that reads and writes files.

    Raises:
        InputError: one is not installed.
    """
    if find_spec("xarray") is None or find_spec(engine) is None:
        raise InputError(f"{what}: needs xarray and {engine}, expected them installed: pip install 'baryscope[io]'")
    import xarray

    return xarray
