"""Tracks from tables in memory, one row per observation: frames of polars or pandas, or a dict of columns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.formats.times import is_missing, seconds_of
from baryscope.estimator.formats.units import Unit, in_metres
from baryscope.estimator.tables.form import Columns
from baryscope.estimator.tables.table import Table
from baryscope.estimator.tables.tracks import FORM, arrays_of
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.arguments import array_of
from baryscope.models.ephemeris.utc import utc_text
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Frame(Protocol):
    """What a frame of polars or pandas has."""

    @property
    def columns(self) -> Any:
        """The names of its columns."""

    def __getitem__(self, key: str, /) -> Any:
        """A column."""


@dataclass(frozen=True)
class _Rows(Table):
    """A table whose rows have no lines."""

    def place(self, row: int) -> str:
        """The row, from 0, for an error."""
        return f"{self.source}, row {row}"


def tracks_of(frame: Frame | Mapping[str, Any], *, units: Unit = "m", source: str = "frame") -> FeatureTracks:
    """Tracks from the columns time, feature, x, y, z and optionally cxx, cxy, cxz, cyy, cyz, czz; others are ignored.

    Rows are those of `FeatureTracks.read_csv`, in any order; NaN, missing and masked values are empty cells.

    Args:
        frame: of polars or pandas, or a mapping from names to columns; time in s, as durations, or in UTC as datetimes
            or texts; datetimes may have a time zone.
        units: of x, y, z; covariances are in its square.
        source: names the frame in errors.

    Raises:
        InputError: one line that names row and column, what was found and what was expected.
    """
    if hasattr(frame, "collect"):
        raise InputError(f"{source}: a lazy frame, expected its rows: frame.collect()")
    if hasattr(frame, "data_vars"):
        raise InputError(f"{source}: a dataset of xarray, expected rows; tracks_of_dataset takes datasets")
    if not isinstance(frame, Mapping) and not hasattr(frame, "columns"):
        raise InputError(
            f"{source}: found {type(frame).__name__}, expected a frame of polars or pandas, or columns by name"
        )
    names = list(frame if isinstance(frame, Mapping) else frame.columns)
    missing = [name for name in FORM.required if name not in names]
    if missing:
        raise InputError(f"{source}: has no column {missing[0]!r}, expected {', '.join(FORM.required)}")
    optional = [name for name in FORM.optional if name in names]
    if optional and len(optional) < len(FORM.optional):
        raise InputError(
            f"{source}: has {', '.join(optional)} only, expected all of {', '.join(FORM.optional)} or none"
        )
    moments = seconds_of(frame["time"], lambda row: f"{source}, row {row}, column time")
    time, epoch = (_numbers(frame["time"], "time", source), None) if moments is None else moments
    numbers = {"time": time} | {name: _numbers(frame[name], name, source) for name in (*"xyz", *optional)}
    labels, codes = _labels(np.asanyarray(frame["feature"]), source)
    if not len(codes) or {len(column) for column in numbers.values()} != {len(codes)}:
        lengths = ", ".join(str(len(column)) for column in (codes, *numbers.values()))
        raise InputError(f"{source}: columns of {lengths} rows, expected as many in all, and at least one")
    table = _Rows(source, Columns(numbers, labels, codes, epoch), b"", FORM)
    arrays = arrays_of(table)
    return in_metres(FeatureTracks(*arrays, epoch=None if epoch is None else utc_text(epoch)), units, source)


def _numbers(column: Any, name: str, source: str) -> FloatArray:
    where, expected = f"{source}, column {name}", "expected finite numbers, one for each row"
    values, logical = array_of(where, column), _is_logical(np.asarray(column))
    if values.ndim != 1 or logical:
        found = "true and false" if logical else f"the shape {values.shape}"
        raise InputError(f"{where}: {found}, {expected}")
    infinite = np.isinf(values)
    if infinite.any():
        raise InputError(f"{source}, row {int(np.argmax(infinite))}, column {name}: an infinite number, {expected}")
    return values


def _is_logical(column: NDArray[Any]) -> bool:
    """Whether a column holds true and false, which count as 1 and 0 elsewhere."""
    if column.dtype == object:  # with missing values
        return any(isinstance(cell, bool) for cell in column.tolist())
    return column.dtype == np.bool_


def _labels(column: NDArray[Any], source: str) -> tuple[tuple[str, ...], IntArray]:
    """Distinct labels in the order of appearance, and each row's index into them, -1 where there is none."""
    if column.ndim != 1:
        raise InputError(f"{source}, column feature: found the shape {column.shape}, expected a label for each row")
    found: dict[str, int] = {}
    codes = np.empty(len(column), dtype=np.intp)
    for row, cell in enumerate(column.tolist()):
        text = "" if is_missing(cell) else str(cell).strip()
        codes[row] = -1 if not text else found.setdefault(text, len(found))
    if not len(column):
        raise InputError(f"{source}: no rows, expected at least one")
    if not found:
        raise InputError(f"{source}, column feature: no label in {len(column)} rows")
    return tuple(found), codes
