"""An estimate as files: the path as a table, and the document beside it as JSON."""

import csv
import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TextIO

import numpy as np

from baryscope.estimator.document.document import document_of
from baryscope.estimator.formats.markers import MARKER_FORMS, with_marker
from baryscope.estimator.formats.write import netcdf, parquet, writer_of_tracks, zarr
from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.result import Estimate, Status
from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import AnyPath, Writer, write_together

STATE = ("x", "y", "z", "vx", "vy", "vz")


def write_estimate(
    result: Estimate,
    path: AnyPath,
    prediction: Prediction | None = None,
    also: Mapping[Path, str | None] | None = None,
    recording: FeatureTracks | None = None,
) -> None:
    """Write the path as a CSV file, and the document beside it with the suffix .json.

    A name that ends in .parquet has the same columns in Parquet, and one in .nc or .zarr has
    `Estimate.to_dataset` in NetCDF or Zarr. One that ends in .trc or .c3d has the recording, with the centre of mass as
    one more marker whose label is the name without ending: only of an estimate whose status is good, as these forms
    have no place for a covariance.
    prediction: goes into a file with the suffix .prediction.csv; also: texts of other files, to be written with these
    or, if one cannot be, not at all. An older prediction, or file of a text that is None, is removed.
    recording: the tracks of which it is, in C, for .trc and .c3d.

    Raises:
        InputError: a file cannot be written, the two names are one, or a recording is missing or not in .trc or .c3d.
        ComputationError: .trc or .c3d, and the status is not good.
    """
    path = Path(path)
    beside = path.with_suffix(".json")
    if beside == path:
        raise InputError(f"{path}: this name is kept for the diagnostics, expected another suffix than .json")
    text = json.dumps(document_of(result).model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False)
    names = ("time", *STATE, *(f"c{one}{other}" for k, one in enumerate(STATE) for other in STATE[k:]))
    writing: dict[Path, Writer | None] = {
        path: _path_writer(result, path)
        if path.suffix not in MARKER_FORMS
        else _marker_writer(result, path, recording),
        beside: lambda stream: stream.write(text + "\n"),
        path.with_suffix(".prediction.csv"): None
        if prediction is None
        else _rows(names, _predicted_columns(prediction)),
    }
    texts = (also or {}).items()
    write_together(
        writing | {file: None if content is None else partial(_write_text, content) for file, content in texts}
    )


def _path_writer(result: Estimate, path: Path) -> Writer:
    names = ("time", "x", "y", "z", *COVARIANCE_COLUMNS)
    match path.suffix:
        case ".parquet":
            return parquet(dict(zip(names, _columns(result), strict=True)))
        case ".nc":
            return netcdf(result.to_dataset())
        case ".zarr":
            return zarr(result.to_dataset())
    return _rows(names, _columns(result))


def _marker_writer(result: Estimate, path: Path, recording: FeatureTracks | None) -> Writer:
    if recording is None:
        raise InputError(f"{path}: has a marker beside those of a recording, expected it")
    if result.status is not Status.GOOD:
        form = path.suffix[1:].upper()
        raise ComputationError(
            f"{path}: the estimate's status is {result.status}, which {form} cannot tell; -o EST.csv"
        )
    return writer_of_tracks(with_marker(recording, path.stem, result.time, result.position, str(path)), path)


def _write_text(content: str, stream: TextIO) -> None:
    stream.write(content)


def _columns(result: Estimate) -> list[list[object]]:
    """Time, position and covariance, whose cells are empty if there is none."""
    n = len(result.time)
    upper = [[None] * n] * 6 if result.covariance is None else elements_of(result.covariance).T.tolist()
    return [result.time.tolist(), *result.position.T.tolist(), *upper]


def _predicted_columns(found: Prediction) -> list[list[object]]:
    """Time, position, velocity, and the upper triangle of their covariance, row by row."""
    states = [values[:, axis].tolist() for values in (found.position, found.velocity) for axis in range(3)]
    rows, columns = np.triu_indices(6)
    covariance = found.covariance[:, rows, columns].T.tolist()
    return [found.time.tolist(), *states, *covariance]


def _rows(names: tuple[str, ...], columns: list[list[object]]) -> Callable[[TextIO], None]:
    """What writes columns as a CSV file."""

    def write(stream: TextIO) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))

    return write
