"""Coordinated universal time (UTC) as text in ISO 8601, and as seconds from an epoch.

Seconds between two times are those of a clock without leap seconds, which were last inserted in 2016.
"""

import re
from datetime import date

import numpy as np

from baryscope.models.errors import InputError

FORM = re.compile(
    r"\s*(\d{4})-(?:(\d{2})-(\d{2})|(\d{3}))(?:[T ](\d{2}):(\d{2})(?::(\d{2})(\.\d+)?)?)?"
    r"\s*(?:Z|z|UTC|([+-])(\d{2})(?::?(\d{2}))?)?\s*"
)
EXPECTED = "a UTC time as 2026-03-01T12:00:00.5Z, or with its offset, as +01:00"
LEAP = ("23", "59", "60")  # hour, minute and second of a leap second
DAY = 86400.0  # s
FIRST, LAST = 1950, 2200  # years; np.datetime64 counts nanoseconds in 64 bits

Moment = np.datetime64  # in ns
Utc = str | date | np.datetime64
"""How a moment is given; datetimes are dates, too."""


def utc_of(given: object, place: str) -> Moment:
    """The moment that a datetime or a text in ISO 8601 names, with month and day or the day of the year; `place` names
    it in errors.

    A time has its offset from UTC behind it, or its time zone, or is in UTC. A date is its midnight.

    Raises:
        InputError: no such time, or a year out of range.
    """
    text = given.isoformat() if isinstance(given, date) else str(given) if isinstance(given, Moment) else given
    found = FORM.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        raise InputError(f"{place}: found {str(text)[:40]!r}, expected {EXPECTED}")
    year, month, day, day_of_year, hour, minute, second, fraction, sign, *offset = found.groups()
    if (hour, minute, second) == LEAP:
        raise InputError(f"{place}: found {str(text)[:40]!r}, leap seconds are not supported, expected {EXPECTED}")
    try:
        midnight = np.datetime64(f"{year}-{month or '01'}-{day or '01'}", "ns")
        midnight += np.timedelta64(int(day_of_year or 1) - 1, "D")
        clock, ahead = ([int(part or 0) for part in parts] for parts in ((hour, minute, second), offset))
        if str(midnight)[:4] != year or day_of_year == "000" or (sign and hour is None):
            raise ValueError
        if max(clock[0], ahead[0]) > 23 or max(*clock, *ahead) > 59:
            raise ValueError
        shift = (-1 if sign == "+" else 1) * (60 * ahead[0] + ahead[1])
        moment = midnight + np.timedelta64(clock[0] * 3600 + (clock[1] + shift) * 60 + clock[2], "s")
        if not all(FIRST <= int(text[:4]) < LAST for text in (year, str(moment))):
            raise ValueError
    except ValueError as error:
        raise InputError(f"{place}: found {str(text)[:40]!r}, expected {EXPECTED}, from {FIRST} on") from error
    nanoseconds = int((fraction or ".0")[1:].ljust(9, "0")[:9])
    return moment + np.timedelta64(nanoseconds, "ns")


def utc_text(moment: Moment) -> str:
    """A moment in ISO 8601, as short as it can be."""
    text = str(moment.astype("datetime64[ns]"))
    return (text.rstrip("0").rstrip(".") if "." in text else text) + "Z"


def seconds_between(begin: Moment, end: Moment) -> float:
    """From `begin` to `end`, in s."""
    difference = end.astype("datetime64[ns]") - begin.astype("datetime64[ns]")
    return int(difference.astype(np.int64)) / 1e9
