"""What a benchmark finds: rows of a table, and faults, which are wrong results and never slow ones."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from rich.table import Table

_SCALES = {"µs": 1e6, "s": 1.0, "MB": 1e-6}


@dataclass(frozen=True)
class Row:
    """One time or amount of memory, with that of a peer.

    Attributes:
        what: what was measured.
        measured: in s or bytes.
        wanted: what it should be at most; not a fault where it is more.
        unit: the unit to print.
        peer: who was measured beside it.
        peers: the peer's value, in s or bytes.
    """

    what: str
    measured: float
    wanted: float
    unit: Literal["µs", "s", "MB"] = "s"
    peer: str = ""
    peers: float | None = None


@dataclass(frozen=True)
class Part:
    """What one part of the benchmark finds.

    Attributes:
        rows: of the common table.
        tables: others.
        faults: one line for each result that is wrong.
    """

    rows: tuple[Row, ...] = ()
    tables: tuple[Table, ...] = ()
    faults: tuple[str, ...] = ()


def exceeds(what: str, error: float, tolerance: float, unit: str) -> list[str]:
    """A fault if an error is larger than its tolerance, or not a number."""
    if error <= tolerance:
        return []
    return [f"{what}: found an error of {error:.3g} {unit}, expected at most {tolerance:g} {unit}"]


def differs(what: str, found: ArrayLike, expected: ArrayLike, tolerance: float) -> list[str]:
    """A fault if two arrays differ by more than `tolerance` of the larger of 1 and the expected value."""
    a, b = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    if a.shape != b.shape:
        return [f"{what}: found {a.size} values, expected {b.size}"]
    error = np.abs(a - b) / np.maximum(1.0, np.abs(b))
    if np.all(error <= tolerance):
        return []
    worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    return [f"{what}: found {a.flat[worst]:.12g} at place {worst}, expected {b.flat[worst]:.12g}"]


def rows_table(rows: Iterable[Row], title: str) -> Table:
    """The rows as a table, with the ratios of the peers' values to ours."""
    table = Table(title=title, title_justify="left")
    for heading in ("what", "measured", "wanted", "peer", "peer's", "ratio"):
        table.add_column(heading, justify="left" if heading in ("what", "peer") else "right")
    for row in rows:
        scale, unit = _SCALES[row.unit], row.unit
        cells = (
            ["", ""] if row.peers is None else [f"{row.peers * scale:.3g} {unit}", f"{row.peers / row.measured:.1f}"]
        )
        measured, wanted = f"{row.measured * scale:.3g} {unit}", f"≤ {row.wanted * scale:g} {unit}"
        table.add_row(row.what, measured, wanted, row.peer, *cells)
    return table
