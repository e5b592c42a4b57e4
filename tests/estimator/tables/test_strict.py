"""The strict reader takes its rows in chunks, which its caller does not see, and for missing what pandas takes."""

import io

import numpy as np
import pandas
import pytest

from baryscope.estimator.tables import FORM, read_strict, strict
from baryscope.models.errors import InputError

SECONDS = [f"{index},a,1,2,3" for index in range(3)]
UTC = [f"2026-03-01T12:00:0{index}Z,a,1,2,3" for index in range(3)]


@pytest.fixture(autouse=True)
def _short_chunks(monkeypatch):
    monkeypatch.setattr(strict, "CHUNK", 3)


def read(rows):
    return read_strict("\n".join(["time,feature,x,y,z", *rows, ""]), "tracks.csv", FORM)


def test_times_go_on_across_chunks():
    later = [row.replace("12:00", "12:01") for row in UTC]
    np.testing.assert_array_equal(read(UTC + later).numbers["time"], [0, 1, 2, 60, 61, 62])
    np.testing.assert_array_equal(read([*SECONDS, "9,a,1,2,3"]).numbers["time"], [0, 1, 2, 9])


@pytest.mark.parametrize(
    "word",
    [" ", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN", "<NA>", "N/A",
     "NA", "NULL", "NaN", "None", "n/a", "nan", "null "],
)  # fmt: skip
def test_what_pandas_takes_for_a_missing_value_is_missing(word):
    """The words of the documentation of `pandas.read_csv`, with blanks around some; labels are texts."""
    rows = [f"0,a,{word},{word},{word}", "0,b,1,2,3", f"1,NA,{word},{word},{word}"]
    theirs = pandas.read_csv(io.StringIO("\n".join(["time,feature,x,y,z", *rows])), skipinitialspace=True)
    ours = read(rows)
    for axis in "xyz":
        np.testing.assert_array_equal(ours.numbers[axis], pandas.to_numeric(theirs[axis].replace("null ", np.nan)))
    assert ours.labels == ("a", "b", "NA")


@pytest.mark.parametrize(("rows", "words"), [
    (SECONDS + UTC, r"line 5, column time: '2026-03-01T12:00:00Z', expected a number of seconds, not a date"),
    ([",a,1,2,3"] * 3 + UTC, r"line 5, column time: '2026-03-01T12:00:00Z', expected a number of seconds, not a date"),
    (UTC + SECONDS, r"line 5, column time: found '0', expected a UTC time as"),
])  # fmt: skip
def test_the_first_row_decides_how_time_is_written_in_all(rows, words):
    with pytest.raises(InputError, match=rf"^tracks\.csv, {words}[^\n]*$"):
        read(rows)
