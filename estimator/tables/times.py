"""The CSV form of times, one column `time`."""

import numpy as np

from baryscope.estimator.limits import LATEST
from baryscope.estimator.tables.clock import seconds_since
from baryscope.estimator.tables.form import FloatArray, Form
from baryscope.estimator.tables.table import read_table
from baryscope.models.ephemeris.utc import utc_of, utc_text
from baryscope.models.files import AnyPath, read_bytes

FORM = Form("times in CSV", ("time",), clock="time")


def read_times(path: AnyPath) -> tuple[FloatArray, str | None]:
    """Times (n,) in s, ascending, of a file with the column `time`, and the UTC of time 0 if they are UTC texts.

    Raises:
        InputError: one line that names file and line, what was found and what was expected.
    """
    table = read_table(read_bytes(path, FORM.what), str(path), FORM)
    time, epoch = table.columns.numbers["time"], table.columns.epoch
    table.refuse(np.isnan(time), "time", "missing, expected a time")
    table.refuse_beyond("time", LATEST, f"a number within ±{LATEST:g} s")
    table.refuse(np.diff(time, prepend=-np.inf) <= 0, "time", "not after the row before, expected ascending times")
    return time, None if epoch is None else utc_text(epoch)


def read_times_in(path: AnyPath, epoch: str | None) -> FloatArray:
    """Times (n,) in s, ascending, of such a file, from the UTC `epoch` of time 0, which UTC times need.

    Raises:
        InputError: one line that names file and line, what was found and what was expected.
    """
    time, own = read_times(path)
    return time if own is None else time + seconds_since(epoch, utc_of(own, str(path)), str(path))
