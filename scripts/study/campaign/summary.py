"""What a campaign gives: its runs, a table for each scenario, and the draws that deserve a look."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import polars as pl

from baryscope.models.words import counted
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.statistics import Remark, Row, bound_of, nees_band, remarks, rows_of
from baryscope.study.campaign.suite import Entry
from baryscope.table import Table

ABOUT_SHORT = (
    "RMSE, pred. (by the covariances) and CRB in mm, time in s. /CRB: RMSE over it, ±",
    "its standard error. NEES at the first, middle and last frame, and in body axes.",
    "fail: draws without a result, + those announced as not to be trusted.",
)  # fmt: skip
SHORT = ("method", "RMSE", "pred.", "/CRB", "±", "target", "NEES", "mid", "end", "body", "fail", "time")
HEADINGS = (
    "method", "RMSE, mm", "predicted RMSE, mm", "RMSE/CRB", "±", "target", "NEES, start", "middle", "end",
    "in body axes", "failed", "time, s",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class CampaignSummary:
    """A campaign and the runs of it that have ended: a table of them, see `read_runs`."""

    plan: Plan
    runs: pl.DataFrame

    @property
    def count(self) -> int:
        """How many runs have ended."""
        return len(self.runs) // len(self.plan.methods)

    def draws(self, entry: Entry) -> int:
        """How many runs of a scenario have ended."""
        return self._draws.get(entry.name, 0)

    @cached_property
    def _draws(self) -> dict[str, int]:
        counts = self.runs.group_by("scenario").len()
        return {str(name): count // len(self.plan.methods) for name, count in counts.iter_rows()}

    def rows(self, entry: Entry) -> list[Row]:
        """A row for each method of a scenario."""
        return rows_of(entry, self.plan, self.runs)

    @property
    def remarks(self) -> list[Remark]:
        """Draws that failed, were announced, or are off by more than chance allows; the first thousand."""
        return self._remarks[1]

    @property
    def remark_count(self) -> int:
        """How many remarks there are."""
        return self._remarks[0]

    @cached_property
    def _remarks(self) -> tuple[int, list[Remark]]:
        return remarks(self.runs)

    @property
    def failures(self) -> pl.Series:
        """Why methods gave no result; as many as there are results if none was given, and some runs at least."""
        return self.runs["failure"].drop_nulls()

    @property
    def failed(self) -> bool:
        """Whether no method gave a result in any run."""
        return len(self.failures) == len(self.runs)

    def tables(self) -> Iterator[Table]:
        """For a terminal or a notebook: a table for each scenario that has runs, lengths in mm."""
        for entry in self.plan.entries:
            if draws := self.draws(entry):
                yield self.table(entry, SHORT, f"{entry.name}: {entry.description}, {counted(draws, 'draw')}")

    def table(self, entry: Entry, headings: tuple[str, ...] = HEADINGS, title: str = "") -> Table:
        """The table of a scenario, the bound's row last; with outliers, a second one for the inliers alone."""
        clean, inliers = bound_of(entry, self.runs)
        empty = ("",) * (len(headings) - 2)
        rows = [_cells(row) for row in self.rows(entry)] + [("CRB", _millimetres(clean), *empty)]
        if clean is not None and inliers != clean:
            rows.append(("CRB, inliers", _millimetres(inliers), *empty))
        return Table(headings, tuple(rows), title)

    def about_nees(self) -> str:
        """Between which numbers a NEES is by chance, in a sentence."""
        draws = max(map(self.draws, self.plan.entries))
        low, high = nees_band(draws)
        band = f"{low:.2f} to {high:.2f} in 95 % of campaigns of {counted(draws, 'draw')}"
        return f"NEES should be 3: {band}; ! marks what is outside."

    def to_json(self) -> dict[str, Any]:
        """The numbers of the tables as plain values: m, s and shares; null where there is none."""
        scenarios = []
        for entry in self.plan.entries:
            clean, inliers = bound_of(entry, self.runs)
            scenarios.append(
                {
                    "name": entry.name,
                    "hash": entry.digest,
                    "draws": self.draws(entry),
                    "crb": clean,
                    "crb_inliers": inliers,
                    "methods": [asdict(row) | {"reached": row.reached} for row in self.rows(entry)],
                }
            )
        return {
            "version": self.plan.version,
            "program": self.plan.program,
            "command": self.plan.command,
            "runs": self.count,
            "missing": self.plan.total - self.count,
            "scenarios": scenarios,
            "remark_count": self.remark_count,
            "remarks": [asdict(remark) for remark in self.remarks],
        }


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.method,
        _millimetres(row.rmse),
        _millimetres(row.predicted_rmse),
        _number(row.ratio),
        _number(row.ratio_error),
        "" if row.target is None else f"{row.target:g} {'ok' if row.reached else 'no'}",
        *(_nees(value, row.draws - row.failed) for value in (*row.nees, row.body_nees)),
        f"{row.failed}+{row.announced}" if row.announced else str(row.failed),
        "-" if row.time is None else f"{row.time:.2f}",
    )


def _number(value: float | None) -> str:
    """Three decimals at most, and hardly more than four digits."""
    if value is None:
        return "-"
    decimals = 3 if value < 10 else 1 if value < 1000 else 0
    return f"{value:.{decimals}f}"


def _nees(value: float | None, draws: int) -> str:
    """The mean of a NEES; with a mark where it is not in the band."""
    if value is None:
        return "-"
    low, high = nees_band(draws)
    mark = "" if low <= value <= high else "!"
    return (f"{value:.2f}" if value < 10 else f"{value:.0f}" if value < 1e4 else f"{value:.0e}") + mark


def _millimetres(metres: float | None) -> str:
    return _number(None if metres is None else 1000 * metres)
