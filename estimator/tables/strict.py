"""The strict reader of CSV tables: row by row, with errors that name the line and the column."""

import csv
import io
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tables.causes import has_decimal_commas, looks_like_numbers, separator_of, wanted_of
from baryscope.estimator.tables.clock import Clock
from baryscope.estimator.tables.form import MISSING, Columns, FloatArray, Form, IntArray
from baryscope.models.errors import InputError
from baryscope.models.words import counted

CHUNK = 50_000  # rows turned into numbers at a time: the strings of a long file are never all in memory


def read_strict(text: str, source: str, form: Form) -> Columns:
    """The columns of a CSV text, row by row; `source` names the file in errors.

    Raises:
        InputError: one line that names file, line and column, what was found and what was expected.
    """
    header = read_header(text, source, form)
    labels: dict[str, int] = {}
    codes: list[IntArray] = []
    chunks: dict[str, list[NDArray[Any]]] = {name: [] for name in header if name != form.label}
    clock: Clock | None = None
    rows = data_rows(text, source)
    while chunk := list(islice(rows, CHUNK)):
        for line, cells in chunk:
            if len(cells) != len(header):
                wanted = f"{len(header)} ({','.join(header)})"
                if has_decimal_commas(cells, len(header)):
                    wanted += ", numbers with a decimal point, not a comma"
                raise InputError(f"{source}, line {line}: {counted(len(cells), 'cell')}, expected {wanted}")
        columns = dict(zip(header, zip(*(cells for _, cells in chunk), strict=True), strict=True))
        texts = [cell.strip() for cell in columns.get(form.label, ())]
        for text_cell in texts:
            if text_cell and text_cell not in labels:
                labels[text_cell] = len(labels)
        lines = [line for line, _ in chunk]
        if form.clock and not codes:  # of the first chunk, for all
            clock = Clock.of(columns[form.clock], lines, f"column {form.clock}", source)
        codes.append(np.array([labels.get(cell, -1) for cell in texts], dtype=np.intp))
        for name, parts in chunks.items():
            if name == form.clock and clock is not None:
                parts.append(clock.nanoseconds(columns[name], lines, f"column {name}", source))
            else:
                parts.append(_numbers(columns[name], name, lines, source))
    if not codes:
        raise InputError(f"{source}: no rows below the header, expected at least one")
    numbers = {name: np.concatenate(parts) for name, parts in chunks.items()}
    epoch = None
    if clock is not None:
        numbers[form.clock], epoch = clock.seconds(numbers[form.clock])
    return Columns(numbers, tuple(labels), np.concatenate(codes), epoch)


def read_header(text: str, source: str, form: Form) -> list[str]:
    """The names of the columns, in the order of the file.

    Raises:
        InputError: a name that is missing, unknown or there twice, or no header at all.
    """
    required, optional = form.required, form.optional
    wanted = ",".join(required) + (f" and, if known, {','.join(optional)}" if optional else "")
    first = text.lstrip("\n").partition("\n")[0]
    if separator := separator_of(first, form):
        raise InputError(f"{source}, line 1: columns separated by {separator}, expected commas, and points in numbers")
    found = next(_rows(text, source), None)
    if found is None:
        raise InputError(f"{source}: the file is empty, expected a header with {wanted}")
    header = [name.strip() for name in found[1]]
    place = f"{source}, line {found[0]}"
    if looks_like_numbers(header):
        raise InputError(f"{place}: numbers in place of a header, expected {wanted}")
    for name in header:
        if header.count(name) > 1:
            raise InputError(f"{place}: column '{name}' stands twice in the header, expected {wanted}")
        if name not in (*required, *optional):
            raise InputError(f"{place}: unknown column '{name}' in the header, expected {wanted}")
    some_optional = any(name in header for name in optional)
    for name in (*required, *(optional if some_optional else ())):
        if name not in header:
            raise InputError(f"{place}: column '{name}' is missing from the header, expected {wanted}")
    return header


def _rows(text: str, source: str) -> Iterator[tuple[int, list[str]]]:
    """The number of the line on which a row ends, and its cells; empty lines are skipped."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        for cells in reader:
            if cells:
                yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"{source}, line {reader.line_num}: {error}, expected a row of CSV cells") from error


def data_rows(text: str, source: str) -> Iterator[tuple[int, list[str]]]:
    """The rows below the header: the number of the line on which each ends, and its cells.

    Raises:
        InputError: a quote that is not closed, or more text behind a closed one.
    """
    return islice(_rows(text, source), 1, None)


def _numbers(cells: Sequence[str], name: str, lines: Sequence[int], source: str) -> FloatArray:
    """The numbers of a column's cells, NaN where one is missing; lines: those of the file, for errors.

    Raises:
        InputError: a cell is no number.
    """
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        values = None
    # Python's float also accepts inf and 1_000, which are no numbers in this file format.
    odd = "_" in "".join(cells) or not cells
    if values is not None and not odd and not np.isinf(values).any():
        return np.where(np.isnan(values), np.nan, values)  # without the sign of -nan
    for cell, line in zip(cells, lines, strict=True):
        if not _is_missing(cell) and not _is_number(cell):
            raise InputError(f"{source}, line {line}, column {name}: {_shortened(cell)}, expected {wanted_of(cell)}")
    return np.array([np.nan if _is_missing(cell) else float(cell) for cell in cells], dtype=np.float64)


def _is_missing(cell: str) -> bool:
    return cell.strip().lower() in MISSING


def _is_number(cell: str) -> bool:
    try:
        return "_" not in cell and bool(np.isfinite(float(cell)))
    except ValueError:
        return False


def _shortened(cell: str) -> str:
    return repr(cell if len(cell) <= 40 else cell[:37] + "...")
