"""A CSV table read by columns: with the fast reader if it certainly reads the same, else with the strict one."""

from codecs import BOM_UTF8
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tables.fast import read_fast
from baryscope.estimator.tables.form import Columns, Form
from baryscope.estimator.tables.strict import data_rows, read_header, read_strict
from baryscope.models.errors import InputError
from baryscope.models.files import decoded

BoolArray = NDArray[np.bool_]

LONG = 1_000_000  # bytes from which the fast reader saves more time than the import of polars takes


@dataclass(frozen=True)
class Table:
    """The columns of a CSV file, and its content, to find the line of a wrong row."""

    source: str  # names the file in errors
    columns: Columns
    content: bytes
    form: Form

    def place(self, row: int) -> str:
        """File and line of a data row, for an error."""
        text = decoded(self.content, self.source, self.form.what)
        for index, (line, _) in enumerate(data_rows(text, self.source)):
            if index == row:
                return f"{self.source}, line {line}"
        raise IndexError(row)

    def refuse(self, wrong: BoolArray, column: str, message: str) -> None:
        """Check that no row is wrong, (rows,).

        Raises:
            InputError: one is; it names the first one's line.
        """
        if wrong.any():
            raise InputError(f"{self.place(int(np.argmax(wrong)))}, column {column}: {message}")

    def refuse_beyond(self, column: str, limit: float, expected: str) -> None:
        """Check that the numbers of a column are within ±limit; missing ones are.

        Raises:
            InputError: one is not.
        """
        values = self.columns.numbers[column]
        wrong = np.abs(values) > limit
        if wrong.any():
            self.refuse(wrong, column, f"{values[int(np.argmax(wrong))]}, expected {expected}")


def read_table(content: bytes, source: str, form: Form) -> Table:
    """Parse the content of a CSV file; `source` names it in errors.

    Cells of the text column are stripped; the others are finite numbers, or missing as `form.MISSING` has it. Columns
    may be in any order.

    Raises:
        InputError: one line that names file, line and column, what was found and what was expected.
    """
    columns = _fast(content, source, form) if len(content) >= LONG and form.label else None
    if columns is None:
        columns = read_strict(decoded(content, source, form.what), source, form)
    return Table(source, columns, content, form)


def _fast(content: bytes, source: str, form: Form) -> Columns | None:
    """The columns of a file that has nothing unusual; None for one that has, of which the strict reader says what."""
    content = content.removeprefix(BOM_UTF8)
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        header = read_header(decoded(content[: content.find(b"\n")], source, form.what), source, form)
    except InputError:
        return None
    return read_fast(content, header, form.label)
