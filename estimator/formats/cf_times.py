"""Times of datasets as the CF conventions have them: numbers, in any unit of time, from any moment or from none."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from baryscope.estimator.tracks import FloatArray
from baryscope.models.ephemeris.utc import utc_text
from baryscope.models.errors import InputError

SECONDS: dict[Fraction, str] = {
    Fraction(1): "s sec secs second seconds",
    Fraction(1, 10**3): "ms msec msecs millisec millisecs millisecond milliseconds",
    Fraction(1, 10**6): "us µs microsec microsecs microsecond microseconds",
    Fraction(1, 10**9): "ns nanosec nanosecs nanosecond nanoseconds",
    Fraction(60): "min mins minute minutes",
    Fraction(3600): "h hr hrs hour hours",
    Fraction(86400): "d day days",
}
"""Seconds in a unit, and how UDUNITS and xarray spell it."""
_MEANT = {name: size for size, names in SECONDS.items() for name in names.split()}


def seconds_of_cf(values: Any, about: Mapping[Any, Any], place: str) -> tuple[FloatArray, str | None]:
    """Times (n,) in s from the moment that `units` names, and the UTC of that; None if it names none.

    Args:
        values: (n,), numbers.
        about: the attributes of the variable, `units` and `calendar`; without units they are seconds.
        place: begins an error.

    Raises:
        InputError: another unit, no such moment, or a calendar whose days are others than those of UTC.
    """
    units = str(about.get("units", "s"))
    unit, since, moment = units.partition(" since ")
    size = _MEANT.get(unit.strip().lower())
    if size is None:
        raise InputError(f"{place}: units {units!r}, expected s, ms, min, h, d, or one of these since a moment")
    given = np.asarray(values, dtype=np.float64)
    seconds = given * size.numerator / size.denominator
    return seconds, _utc_of(moment, about.get("calendar", "standard"), place) if since else None


def _utc_of(moment: str, calendar: Any, place: str) -> str:
    """The UTC of a moment as CF has it: digits may be left out, and a time zone may stand behind."""
    import xarray

    about = {"units": f"seconds since {moment}", "calendar": calendar}
    try:
        decoded = xarray.decode_cf(xarray.Dataset(coords={"time": ("time", [0], about)}))["time"].values
    except (ValueError, OverflowError, ImportError):
        decoded = np.zeros(1)
    if decoded.dtype.kind != "M":  # of another calendar, as one without leap days
        raise InputError(
            f"{place}: since {moment!r} in the calendar {calendar!r}, expected a moment in UTC, as "
            "2026-03-01 12:00:00, in the standard calendar"
        )
    return utc_text(decoded[0])
