"""Why a table probably cannot be read: other separators, decimal commas, dates; in words for the message."""

import re
from collections.abc import Sequence

from baryscope.estimator.tables.form import Form

SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", " ": "blanks"}
DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d*(e[+-]?\d+)?\s*", re.IGNORECASE)
DATE = re.compile(r"\s*(\d{4}-\d{1,2}-\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{2,4}|\d{1,2}:\d{2})(?!\d).*")
WHOLE = re.compile(r"\s*[+-]?\d*(e[+-]?\d+)?\s*", re.IGNORECASE)


def separator_of(line: str, form: Form) -> str | None:
    """What separates the names of a header line, if it is not commas: "tabs", "semicolons", "bars" or "blanks"."""
    for separator, name in SEPARATORS.items():
        names = {part.strip().strip('"') for part in line.split(separator)}
        if names >= set(form.required):
            return name
    return None


def looks_like_numbers(header: Sequence[str]) -> bool:
    """Whether what should be a header is a row of numbers, but for one text at most."""
    return len(header) > 1 and sum(not _is_number(cell) for cell in header) <= 1


def has_decimal_commas(cells: Sequence[str], columns: int) -> bool:
    """Whether a row of so many columns may have more cells than that because its numbers have decimal commas."""
    return columns + 1 < len(cells) < 2 * columns and sum(not WHOLE.fullmatch(cell) for cell in cells) <= 1


def wanted_of(cell: str) -> str:
    """What a cell should hold that is not a finite number, and why it may not be one."""
    if DECIMAL_COMMA.fullmatch(cell):
        return "a finite number, with a decimal point"
    if DATE.fullmatch(cell):
        return "a number of seconds, not a date or a time of day"
    return "a finite number"


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
