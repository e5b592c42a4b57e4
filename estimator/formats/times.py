"""Times in memory that are no numbers, in seconds: datetimes, durations and UTC texts."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.models.ephemeris.utc import FORM, Moment, utc_of
from baryscope.models.errors import InputError

FloatArray = NDArray[np.float64]

SECOND = np.timedelta64(1, "s")


def seconds_of(times: Any, place: Callable[[int], str]) -> tuple[FloatArray, Moment | None] | None:
    """Seconds (n,), and the moment from which they count: the earliest of datetimes or UTC texts.

    Datetimes are in UTC, or in a time zone that they tell. Durations count from no moment, and are NaN where missing.

    Args:
        times: (n,), an array, a list, or a column of polars or pandas.
        place: where the time of an index stands; begins an error.

    Returns:
        None if these are no such times but, as it seems, numbers.

    Raises:
        InputError: a datetime that is missing, a text that is no UTC time, or a cell of another kind than the first.
    """
    column = _column_of(times, place)
    if column.dtype.kind == "m":
        return column / SECOND, None
    if column.dtype.kind != "M":
        return None
    missing = np.isnat(column)
    if missing.any():
        raise InputError(f"{place(int(np.argmax(missing)))}: missing, expected a datetime")
    moments = column.astype("datetime64[ns]")
    epoch = moments.min()
    return (moments - epoch) / SECOND, epoch


def _column_of(times: Any, place: Callable[[int], str]) -> NDArray[Any]:
    """The times as an array, of datetimes (in UTC) or durations if they are some in whatever form."""
    if getattr(getattr(times, "dtype", None), "kind", "") == "M" and not isinstance(times, np.ma.MaskedArray):
        return np.asarray(times, dtype="datetime64[ns]")  # of pandas, with a time zone
    column: NDArray[Any] = np.asanyarray(times)
    if column.dtype.kind in "mM":
        return np.where(np.ma.getmaskarray(column), np.array("NaT", column.dtype), np.asarray(column))
    if column.dtype.kind not in "OUT":
        return column
    cells = column.tolist()
    match next((cell for cell in cells if not is_missing(cell)), None):
        case str(text) if FORM.fullmatch(text):
            return _moments(cells, place)
        case datetime():
            return np.array([_naive(cell, place(row)) for row, cell in enumerate(cells)], dtype="datetime64[ns]")
        case timedelta():
            durations = [_checked(cell, timedelta, place(row)) for row, cell in enumerate(cells)]
            return np.array(durations, dtype="timedelta64[ns]")
    return column


def is_missing(cell: Any) -> bool:
    """Whether a cell is None, NaN, NaT, or the missing value of pandas, which does not tell what it equals."""
    try:
        return cell is None or bool(cell != cell)
    except TypeError:
        return True


def _checked(cell: Any, kind: type, place: str) -> Any:
    """A cell of a kind, or None if it is missing."""
    if is_missing(cell):
        return None
    if not isinstance(cell, kind):
        words = "a datetime" if kind is datetime else "a duration"
        raise InputError(f"{place}: found {str(cell)[:40]!r}, expected {words}")
    return cell


def _naive(cell: Any, place: str) -> datetime | None:
    """A datetime in UTC, without its time zone, or None if it is missing."""
    moment: datetime | None = _checked(cell, datetime, place)
    return moment if moment is None or moment.tzinfo is None else moment.astimezone(UTC).replace(tzinfo=None)


def _moments(cells: Sequence[Any], place: Callable[[int], str]) -> NDArray[np.datetime64]:
    """The moments that UTC texts name; a text that stands in many rows is read once."""
    known: dict[str, Moment] = {}
    for row, cell in enumerate(cells):
        if str(cell) not in known:
            known[str(cell)] = utc_of(cell, place(row))
    return np.array([known[str(cell)] for cell in cells], dtype="datetime64[ns]")
