"""Likely causes of an unreadable table, in words for the message: other separators, decimal commas, dates."""

import re
from collections.abc import Sequence

from baryscope.estimator.tables.form import Form
from baryscope.models.ephemeris.utc import EXPECTED

SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", " ": "blanks"}
DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d*(e[+-]?\d+)?\s*", re.IGNORECASE)
DATE = re.compile(r"\s*(\d{4}-\d{1,2}-\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{2,4}|\d{1,2}:\d{2})(?!\d).*")
WHOLE = re.compile(r"\s*[+-]?\d*(e[+-]?\d+)?\s*", re.IGNORECASE)


def separator_of(line: str, form: Form) -> str | None:
    """The separator of a header line, if it is not a comma: "tabs", "semicolons", "bars" or "blanks"."""
    for separator, name in SEPARATORS.items():
        names = {part.strip().strip('"') for part in line.split(separator)}
        if separator in line and names >= set(form.required):
            return name
    return None


def looks_like_numbers(header: Sequence[str]) -> bool:
    """Whether the header is a row of numbers with at most one text."""
    return len(header) > 1 and sum(not _is_number(cell) for cell in header) <= 1


def has_decimal_commas(cells: Sequence[str], columns: int) -> bool:
    """Whether a row has more cells than the table has columns, probably because its numbers have decimal commas."""
    return columns + 1 < len(cells) < 2 * columns and sum(not WHOLE.fullmatch(cell) for cell in cells) <= 1


def wanted_of(cell: str) -> str:
    """What is expected in a cell that has no finite number, with the likely cause."""
    if DECIMAL_COMMA.fullmatch(cell):
        return "a finite number, with a decimal point"
    if DATE.fullmatch(cell):
        return f"a number of seconds, not a date or a time of day; or, from the first row on, {EXPECTED}"
    return "a finite number"


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
