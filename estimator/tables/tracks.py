"""The CSV form of feature tracks, one row per observation, and its rows as arrays over frames and features."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.symmetric import FULL, is_covariance
from baryscope.estimator.limits import COARSEST, FARTHEST, LATEST
from baryscope.estimator.tables.form import FloatArray, Form, IntArray
from baryscope.estimator.tables.table import Table
from baryscope.models.errors import InputError
from baryscope.models.variables import UPPER
from baryscope.models.words import counted

BoolArray = NDArray[np.bool_]

COLUMNS = ("time", "feature", "x", "y", "z")
COVARIANCE_COLUMNS = tuple(f"c{element}" for element in UPPER)  # what `elements_of` gives of a matrix
MOST_PLACES = 10**8  # frames times features: 2.4 GB of positions, three times that of covariances
FORM = Form("feature tracks in CSV", COLUMNS, COVARIANCE_COLUMNS, "feature", "time")


def arrays_of(table: Table) -> tuple[FloatArray, FloatArray, tuple[str, ...], FloatArray | None]:
    """Time (n,), position (n, m, 3), labels (m) and covariance (n, m, 3, 3), or None, from the rows of a file.

    NaN means not seen, as missing cells do. Whether the covariances are positive semidefinite is checked elsewhere.

    Raises:
        InputError: an incomplete position, a position without a label or time, one given twice, a number out of range.
    """
    numbers, labels, codes = table.columns.numbers, table.columns.labels, table.columns.codes
    empty = np.stack([np.isnan(numbers[axis]) for axis in "xyz"])
    table.refuse(np.isnan(numbers["time"]), "time", "missing, expected a number of seconds")
    table.refuse_beyond("time", LATEST, f"a number of seconds within ±{LATEST:g}")
    seen = np.asarray(~empty.all(axis=0))
    for index, axis in enumerate("xyz"):
        table.refuse(seen & empty[index], axis, "missing, expected a number (x, y and z, or none of them)")
        table.refuse_beyond(axis, FARTHEST, f"a number of metres within ±{FARTHEST:g}")
    table.refuse(seen & (codes < 0), "feature", "empty, expected the label of the feature at this position")
    time, frame = _frames(numbers["time"])
    _refuse_sparse(table, len(time), len(labels))
    place = frame * len(labels) + codes
    _refuse_repetition(table, place, len(time) * len(labels))
    _check_covariance_cells(table, seen)
    rows, place = (slice(None), place) if seen.all() else (seen, place[seen])
    position = np.full((len(time), len(labels), 3), np.nan)
    for index, axis in enumerate("xyz"):
        position.reshape(-1, 3)[place, index] = numbers[axis][rows]
    if COVARIANCE_COLUMNS[0] not in numbers:
        return time, position, labels, None
    covariance = np.full((len(time), len(labels), 3, 3), np.nan)
    covariance.reshape(-1, 3, 3)[place] = _matrices(numbers)[rows]
    return time, position, labels, covariance


def refuse_covariances(table: Table) -> None:
    """Check that the covariances of the rows are positive semidefinite.

    Raises:
        InputError: one is not; the message names the row.
    """
    numbers = table.columns.numbers
    if COVARIANCE_COLUMNS[0] in numbers:
        wrong = ~is_covariance(_matrices(numbers)) & ~np.isnan(numbers["x"])
        table.refuse(wrong, "cxx to czz", "not positive semidefinite, expected a covariance matrix in m²")


def _matrices(numbers: Mapping[str, FloatArray]) -> FloatArray:
    """The covariances (rows, 3, 3) of the six columns."""
    return np.stack([numbers[name] for name in COVARIANCE_COLUMNS], axis=1)[:, FULL]


def _frames(time: FloatArray) -> tuple[FloatArray, IntArray]:
    """The distinct times, ascending, and each row's index into them."""
    steps = np.diff(time)
    if (steps < 0).any():
        return np.unique(time, return_inverse=True)
    begins = np.concatenate([[True], steps > 0])
    return time[begins], np.cumsum(begins) - 1


def _refuse_sparse(table: Table, times: int, labels: int) -> None:
    if times * labels > MOST_PLACES:
        raise InputError(
            f"{table.source}: {counted(times, 'time')} and {counted(labels, 'label')} in "
            f"{counted(len(table.columns.codes), 'row')}, expected one time for all features of a frame, "
            "and the same label wherever a feature is seen again"
        )


def _refuse_repetition(table: Table, place: IntArray, places: int) -> None:
    """Check that no pair of frame and feature is given twice; place (rows,): index of a row's pair among `places`."""
    named = table.columns.codes >= 0
    taken = np.zeros(places, dtype=bool)
    taken[place[named]] = True
    if np.count_nonzero(taken) == np.count_nonzero(named):
        return
    again = np.ones(len(place), dtype=bool)
    again[np.unique(np.where(named, place, -1 - np.arange(len(place))), return_index=True)[1]] = False
    row = int(np.argmax(again))
    label, time = table.columns.labels[table.columns.codes[row]], table.columns.numbers["time"][row]
    raise InputError(f"{table.place(row)}, column feature: {label!r} stands twice at {time} s, expected once")


def _check_covariance_cells(table: Table, seen: BoolArray) -> None:
    for name in COVARIANCE_COLUMNS:
        if name in table.columns.numbers:
            empty = np.isnan(table.columns.numbers[name])
            table.refuse(seen & empty, name, "missing, expected a number (all six, wherever x, y, z stand)")
            table.refuse(~seen & ~empty, name, "a number without a position, expected an empty cell")
            table.refuse_beyond(name, COARSEST**2, f"a number of m² within ±{COARSEST**2:g}")
