"""Times of a table that are UTC texts, as seconds from the earliest of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tables.form import FloatArray
from baryscope.models.ephemeris.utc import FORM, Moment, seconds_between, utc_of
from baryscope.models.errors import InputError

EMPTY = np.iinfo(np.int64).min  # of nanoseconds


class Clock:
    """Reads the cells of a column of UTC times; a time that stands in many rows is read once."""

    def __init__(self, first: Moment) -> None:
        self.first = first
        self._known: dict[str, int] = {"": EMPTY}

    @classmethod
    def of(cls, cells: Sequence[str], lines: Sequence[int], column: str, source: str) -> "Clock | None":
        """The clock of a column whose first cell that is not empty has the form of a UTC time; None for any other.

        Raises:
            InputError: that cell is no UTC time; names its line and column.
        """
        first = next((index for index, cell in enumerate(cells) if cell.strip()), 0)
        if not FORM.fullmatch(cells[first]):
            return None
        return cls(utc_of(cells[first], f"{source}, line {lines[first]}, {column}"))

    def nanoseconds(self, cells: Sequence[str], lines: Sequence[int], column: str, source: str) -> NDArray[np.int64]:
        """Nanoseconds (rows,) from the first cell, EMPTY for empty cells.

        Raises:
            InputError: a cell that is no UTC time; names its line and column.
        """
        for cell, line in zip(cells, lines, strict=True):
            if cell not in self._known:
                moment = utc_of(cell, f"{source}, line {line}, {column}") if cell.strip() else None
                self._known[cell] = EMPTY if moment is None else int((moment - self.first).astype(np.int64))
        return np.array([self._known[cell] for cell in cells], dtype=np.int64)

    def seconds(self, nanoseconds: NDArray[np.int64]) -> tuple[FloatArray, Moment]:
        """Seconds (rows,) from the earliest of the times, NaN for empty cells, and the moment of that."""
        empty = nanoseconds == EMPTY
        earliest = int(nanoseconds[~empty].min(initial=np.iinfo(np.int64).max)) if not empty.all() else 0
        seconds = np.where(empty, np.nan, (nanoseconds - earliest) / 1e9)
        return seconds, self.first + np.timedelta64(earliest, "ns")


def seconds_since(epoch: str | None, moment: Moment, source: str) -> float:
    """Seconds from the UTC `epoch`, that of time 0 of the tracks, to the moment from which a file's times count.

    Raises:
        InputError: no epoch is known.
    """
    if epoch is None:
        raise InputError(f"{source}: UTC times, expected seconds, as in the tracks; or UTC times there, or --epoch")
    return seconds_between(utc_of(epoch, "epoch"), moment)
