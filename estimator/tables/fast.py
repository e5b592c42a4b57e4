"""The fast reader of CSV tables: polars, for files of which it certainly reads the same as the strict reader.

A file with an unusual form is left to the strict reader, which reads it or reports the error.
"""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.tables.form import Columns, IntArray

BLOCK = 1 << 18  # bytes counted at a time: few enough for the processor's cache
COMMA, LINE_BREAK, QUOTE = b',\n"'
ENDS = np.frombuffer(b",\n", np.uint8)


def read_fast(content: bytes, header: Sequence[str], label: str) -> Columns | None:
    """The rows below the first line of `content`, or None if the strict reader is needed.

    content: UTF-8 without a byte order mark, lines ended by "\\n". Column `label` is text, the others are finite
    numbers, NaN or empty. None means that a row is short or long, a line is empty, a quote is not around a whole cell,
    a number is infinite or not plain, as NA is, the text is not UTF-8, or polars does not support the processor; the
    file may be valid.
    """
    if content.endswith(b"\n\n") or not content.endswith(b"\n"):
        content = content.rstrip(b"\n") + b"\n"
    lines = _count(content, LINE_BREAK)
    if lines < 2 or _count(content, COMMA) != lines * (len(header) - 1) or not _quotes_are_plain(content):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            import polars as pl  # here, as it takes as long as reading some thousand rows with the strict reader
        except RuntimeWarning:  # of a processor that it does not support
            return None
    types = {name: pl.String if name == label else pl.Float64 for name in header}
    try:
        frame = pl.read_csv(content, schema=types)
    except pl.exceptions.PolarsError:
        return None
    numbers = [name for name in header if name != label]
    if frame.height != lines - 1 or any(frame[name].is_infinite().any() for name in numbers):
        return None
    if any(frame[name].is_nan().any() for name in numbers):
        frame = frame.with_columns(pl.col(numbers).fill_nan(None))  # which all have the bits of np.nan
    texts = frame[label].fill_null("")
    known = texts.unique(maintain_order=True)
    codes = texts.cast(pl.Enum(known)).to_physical().to_numpy()
    return Columns({name: frame[name].to_numpy() for name in numbers}, *_stripped(known.to_list(), codes))


def _count(content: bytes, byte: int) -> int:
    view = np.frombuffer(content, np.uint8)
    return sum(int(np.count_nonzero(view[start : start + BLOCK] == byte)) for start in range(0, len(view), BLOCK))


def _quotes_are_plain(content: bytes) -> bool:
    """Whether every cell has quotes at its begin and end only, or none."""
    if QUOTE not in content:
        return True
    view = np.frombuffer(content, np.uint8)
    places = np.flatnonzero(view == QUOTE)
    opening, closing = places[::2], places[1::2]
    return (
        len(opening) == len(closing)
        and bool(np.isin(view[opening[opening > 0] - 1], ENDS).all())
        and bool(np.isin(view[closing + 1], ENDS).all())
    )


def _stripped(texts: Sequence[str], codes: NDArray[np.integer]) -> tuple[tuple[str, ...], IntArray]:
    """The distinct texts without surrounding blanks, none empty, and `codes` (rows,) into them, -1 for empty ones."""
    labels: dict[str, int] = {}
    index = [labels.setdefault(text.strip(), len(labels)) if text.strip() else -1 for text in texts]
    return tuple(labels), np.array(index, dtype=np.intp)[codes]
