"""The expected form of a CSV table, the words of its cells without a number, and its columns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

MISSING = frozenset(
    ["", "nan", "-nan", "+nan", "na", "<na>", "n/a", "#na", "#n/a", "#n/a n/a", "null", "none"]
    + [sign + word for sign in ("", "-") for word in ("1.#ind", "1.#qnan")]
)  # in lower case: what pandas.read_csv takes for a missing value


@dataclass(frozen=True)
class Form:
    """The form of a table: required columns, optional columns (all or none), the one column of text, if any, and the
    column that may hold UTC times, if any."""

    what: str  # "feature tracks in CSV", for errors
    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    label: str = ""
    clock: str = ""


@dataclass(frozen=True)
class Columns:
    """Columns of a table: numbers (rows,) with NaN for cells that have none, and one text column as codes.

    epoch: the moment from which the column of times counts, the earliest in the file, if it holds UTC times.
    """

    numbers: dict[str, FloatArray]
    labels: tuple[
        str, ...
    ]  # distinct texts in the order of appearance, without blanks around and without the empty one
    codes: IntArray  # (rows,) index into labels, -1 where the cell is empty
    epoch: np.datetime64 | None = None
