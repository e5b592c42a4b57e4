"""The report of a campaign: its tables, how errors and NEES are distributed over the draws, and draws to look at."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import chdtr

from baryscope.models.words import counted
from baryscope.report import Report
from baryscope.report.charts import curve
from baryscope.report.document import Chart, Facts, Part, Series, Sheet, Tabs, Words
from baryscope.study.campaign.marginals import marginals
from baryscope.study.campaign.markdown import LEGEND, MOST_REMARKS, varied_words
from baryscope.study.campaign.statistics import DEGREES
from baryscope.study.campaign.suite import Entry
from baryscope.study.campaign.summary import HEADINGS, CampaignSummary
from baryscope.study.campaign.table import NEES
from baryscope.study.methods import COLOURS

FloatArray = NDArray[np.float64]

LEAST = 1e-9  # of what stands on a logarithmic axis


def report_of_campaign(summary: CampaignSummary) -> Report:
    """The report of the runs that have ended."""
    plan = summary.plan
    entries = [entry for entry in plan.entries if summary.draws(entry)]
    rows = [(entry.name, *row) for entry in entries for row in summary.table(entry).rows]
    left = plan.total - summary.count
    missing = f"; {left} still missing" if left else ""
    parts: list[Part] = [
        Sheet("All scenarios", ("scenario", *HEADINGS), tuple(rows), " ".join([*LEGEND, summary.about_nees()]), 2),
        Tabs("Each scenario", tuple((entry.name, _parts_of(entry, summary)) for entry in entries)),
    ]
    if summary.remarks:
        lines = [f"{one.scenario} {one.case}, {one.method}: {one.text}" for one in summary.remarks[:MOST_REMARKS]]
        more = summary.remark_count - len(lines)
        parts.append(Words("Draws to look at", (*lines, *([f"and {more} more"] if more else []))))
    parts.append(_options(summary))
    return Report(
        f"Campaign: {counted(len(entries), 'scenario')}, {counted(summary.count, 'run')}",
        f"{counted(plan.draws, 'draw')} of each scenario, seed {plan.seed}{missing}",
        plan.version,
        tuple(parts),
        notes=("No run gave a result.",) if summary.failed else (),
    )


def with_parts(report: Report, more: Mapping[str, tuple[Part, ...]], about: str) -> Report:
    """The report of a campaign with more parts in the tabs of its scenarios, by their names."""

    def extended(part: Part) -> Part:
        if not isinstance(part, Tabs):
            return part
        choices = tuple((name, (*parts, *more.get(name, ()))) for name, parts in part.choices)
        return replace(part, choices=choices, about=about)

    return replace(report, parts=tuple(map(extended, report.parts)))


def _options(summary: CampaignSummary) -> Facts:
    plan = summary.plan
    items = [
        ("command", plan.command),
        ("methods", ", ".join(plan.methods)),
        ("varied", varied_words(plan)),
        ("program", plan.program),
        ("baryscope", plan.version),
    ]
    return Facts("Options and version", tuple(items))


def _parts_of(entry: Entry, summary: CampaignSummary) -> tuple[Part, ...]:
    runs = summary.runs.filter(pl.col("scenario") == entry.name)
    parts: list[Part] = [Words("Scenario", (entry.description or entry.name,))]
    errors = [_errors(label, runs) for label in summary.plan.methods]
    bound = _sorted(1e3 * runs.filter(pl.col("method").to_physical() == 0)["bound"])
    if bound.size:
        errors.append(_distribution("Cramér–Rao bound", bound, style="dashed"))
    parts.append(
        _shares(
            "Errors over the draws",
            "The share of draws whose path's RMSE is at most that of the axis; draws that failed are never below it.",
            "RMSE of the path in mm",
            errors,
        )
    )
    normalised = [one for label in summary.plan.methods if (one := _nees(label, runs)) is not None]
    if normalised:
        x = np.geomspace(0.01, 100, 200)
        expected = Series("χ² of 3 degrees of freedom", x, chdtr(DEGREES, x), "ink", "dashed")
        parts.append(
            _shares(
                "NEES over the draws",
                "The share of draws whose NEES at the middle frame is at most that of the axis: right of the dashed "
                "curve a method promises too much, left of it too little.",
                "eᵀ P⁻¹ e",
                [*normalised, expected],
            )
        )
    return (*parts, *marginals(summary.plan, runs))


def _shares(title: str, about: str, x_label: str, series: list[Series | None]) -> Chart:
    some = tuple(one for one in series if one is not None)
    return Chart(title, about, "share of the draws", some, x_label=x_label, log_x=True, timed=False)


def _errors(label: str, runs: pl.DataFrame) -> Series | None:
    own = runs.filter(pl.col("method") == label)
    values = _sorted(1e3 * own.filter(pl.col("failure").is_null())["rmse"])
    return _distribution(label, values, len(own), COLOURS[label]) if values.size else None


def _nees(label: str, runs: pl.DataFrame) -> Series | None:
    values = _sorted(runs.filter(pl.col("method") == label)[NEES[1]])
    return _distribution(label, values, None, COLOURS[label]) if values.size else None


def _sorted(values: pl.Series) -> FloatArray:
    found: FloatArray = np.sort(np.maximum(values.drop_nulls().to_numpy(), LEAST))
    return found


def _distribution(label: str, values: FloatArray, total: int | None = None, colour: Any = "ink", **how: Any) -> Series:
    """The share of `total` draws up to each of the sorted values, as steps."""
    x, y = np.repeat(values, 2), np.repeat(np.arange(len(values) + 1), 2)[1:-1] / (total or len(values))
    return curve(label, x, y, colour=colour, **how)
