"""The CSV form of a log of accelerations, `time,ax,ay,az`."""

import numpy as np

from baryscope.estimator.limits import LATEST
from baryscope.estimator.tables.clock import seconds_since
from baryscope.estimator.tables.form import FloatArray, Form
from baryscope.estimator.tables.table import read_table
from baryscope.estimator.thrust import STRONGEST
from baryscope.models.files import AnyPath, read_bytes

COLUMNS = ("time", "ax", "ay", "az")
FORM = Form("accelerations in CSV", COLUMNS, clock="time")


def read_acceleration(path: AnyPath, epoch: str | None = None) -> tuple[FloatArray, FloatArray]:
    """Times (k,) in s and accelerations (k, 3) in m/s² of a file `time,ax,ay,az`, in ascending order of time.

    epoch: UTC of time 0, if it is known; a file with UTC times needs it.

    Raises:
        InputError: one line that names file, line and column, what was found and what was expected.
    """
    table = read_table(read_bytes(path, FORM.what), str(path), FORM)
    columns = table.columns
    for name in COLUMNS:
        limit, unit = (LATEST, "s") if name == "time" else (STRONGEST, "m/s²")
        expected = f"a number within ±{limit:g} {unit}"
        table.refuse(np.isnan(columns.numbers[name]), name, f"missing, expected {expected}")
        table.refuse_beyond(name, limit, expected)
    time = columns.numbers["time"]
    if columns.epoch is not None:
        time = time + seconds_since(epoch, columns.epoch, str(path))
    late = np.diff(time, prepend=-np.inf) <= 0
    table.refuse(late, "time", "not after the row before, expected ascending times")
    return time, np.stack([columns.numbers[name] for name in COLUMNS[1:]], axis=1)
