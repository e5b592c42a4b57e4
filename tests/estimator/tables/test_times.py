"""Files of times: tables of one column."""

import numpy as np
import pytest

from baryscope.estimator.tables.times import read_times
from baryscope.models.errors import InputError


def written(tmp_path, text):
    path = tmp_path / "times.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_seconds_and_utc(tmp_path):
    time, epoch = read_times(written(tmp_path, "time\n0.5\n1.5\n3\n"))
    np.testing.assert_array_equal(time, [0.5, 1.5, 3.0])
    assert epoch is None
    time, epoch = read_times(written(tmp_path, "time\n2030-01-01T00:00:01Z\n2030-01-01T00:00:03.5Z\n"))
    np.testing.assert_array_equal(time, [0.0, 2.5])
    assert epoch is not None
    assert epoch.startswith("2030-01-01T00:00:01")


@pytest.mark.parametrize(("text", "words"), [
    ("time\n0\n0\n", r"line 3, column time: not after the row before"),
    ("time\n0\n1e300\n", r"line 3, column time: 1e\+300, expected a number within"),
    ("seconds\n0\n", r"line 1"),
    ("time\n", r"no rows below the header"),
])  # fmt: skip
def test_a_wrong_file_is_one_line(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        read_times(written(tmp_path, text))
