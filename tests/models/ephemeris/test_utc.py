"""UTC texts against Python's datetime."""

from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.ephemeris.utc import seconds_between, utc_of, utc_text
from baryscope.models.errors import InputError

moments = st.datetimes(datetime(1950, 1, 1), datetime(2199, 12, 31))


@given(first=moments, second=moments)
def test_seconds_between_two_texts(first, second):
    found = seconds_between(utc_of(first.isoformat(), "here"), utc_of(second.isoformat() + "Z", "here"))
    assert found == pytest.approx((second - first).total_seconds(), abs=1e-6)


@given(moments)
def test_a_text_is_read_back(moment):
    read = utc_of(moment.strftime("%Y-%jT%H:%M:%S.%f"), "here")
    assert datetime.fromisoformat(utc_text(read)) == moment.replace(tzinfo=UTC)
    assert utc_of(utc_text(read), "here") == read


@given(moments, st.integers(-(24 * 60 - 1), 24 * 60 - 1), st.sampled_from(["", ":"]))
def test_a_text_with_an_offset_names_the_moment_that_datetime_has(moment, minutes, colon):
    local = moment.replace(tzinfo=timezone(timedelta(minutes=minutes)))
    sign, (hours, rest) = "-" if minutes < 0 else "+", divmod(abs(minutes), 60)
    text = local.strftime("%Y-%m-%dT%H:%M:%S.%f") + f"{sign}{hours:02}{colon}{rest:02}"
    assert datetime.fromisoformat(text) == local
    there = local.astimezone(UTC)
    if 1950 <= there.year < 2200:
        assert datetime.fromisoformat(utc_text(utc_of(text, "here"))) == there
    else:
        with pytest.raises(InputError, match="from 1950 on"):
            utc_of(text, "here")


def test_hours_alone_are_an_offset_too():
    assert utc_text(utc_of("2026-03-01 12:00 -05", "here")) == "2026-03-01T17:00:00Z"
    assert utc_text(utc_of("2026-060T00:30+01", "here")) == "2026-02-28T23:30:00Z"


def test_nanoseconds_are_kept():
    start = utc_of("2026-03-01T12:00:00.000000001Z", "here")
    assert utc_text(start) == "2026-03-01T12:00:00.000000001Z"
    assert utc_text(utc_of("2026-03-01", "here")) == "2026-03-01T00:00:00Z"
    assert seconds_between(start, utc_of("2026-03-01 12:00:01", "here")) == pytest.approx(0.999999999, rel=1e-15)


@pytest.mark.parametrize("text, moment", [
    ("2026-03-01T12:00:00.25Z", datetime(2026, 3, 1, 12, 0, 0, 250000)),
    ("2026-03-01T12:00:00Z", datetime(2026, 3, 1, 13, tzinfo=timezone(timedelta(hours=1)))),
    ("2026-03-01T12:00:00Z", pd.Timestamp("2026-03-01T07:00", tz="America/New_York")),
    ("2026-03-01T00:00:00Z", np.datetime64("2026-03-01")),
    ("2026-03-01T00:00:00Z", date(2026, 3, 1)),
    ("2026-03-01T12:00:00.000000001Z", np.datetime64("2026-03-01T12:00:00.000000001")),
    ("2026-03-01T12:00:00.000000001Z", pd.Timestamp("2026-03-01T12:00:00.000000001")),
])  # fmt: skip
def test_datetimes_are_those_of_the_texts(text, moment):
    """Those without a time zone are in UTC, as in a column of times."""
    assert utc_text(utc_of(moment, "here")) == text


@pytest.mark.parametrize("text", ["2016-12-31T23:59:60Z", "2015-181 23:59:60.5"])
def test_a_leap_second_is_refused_as_one(text):
    with pytest.raises(InputError, match=r"^epoch: found .*, leap seconds are not supported, expected a UTC time as"):
        utc_of(text, "epoch")


@pytest.mark.parametrize(
    "text",
    ["", "noon", "2026-02-30", "2026-000", "2026-366", "2026-01-01T24:00", "2026-01-01T12:60", "2026-01-01T12:00:60Z",
     "1900-01-01", "2026-01-01T12:00:00+24:00", "2026-01-01T12:00:00-01:60", "2026-01-01+01:00",
     "2026-01-01T12:00:00+01:00Z", "2026-01-01T12:00:00+1:00", "2026-01-01T12:00:00Z x", None, 3.0,
     np.datetime64("NaT"), np.datetime64("1900-01-01"), pd.NaT],
)  # fmt: skip
def test_what_is_no_utc_time_is_refused_in_one_line(text):
    with pytest.raises(InputError, match=r"^epoch: found .*expected a UTC time as [^\n]*$"):
        utc_of(text, "epoch")
