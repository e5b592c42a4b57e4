"""How the error depends on each field that varies: quantiles over the draws in parts of its range.

A part holds equally many draws, so that a chart has as many points for 100,000 draws as for 1000.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from baryscope.models.scenario import Scenario
from baryscope.models.scenario.schema import field_at
from baryscope.report.document import Chart, Series, Tabs
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.reading import varied_fields
from baryscope.study.campaign.statistics import nees_band
from baryscope.study.campaign.table import NEES
from baryscope.study.campaign.vary import path_of
from baryscope.study.methods import COLOURS

FloatArray = NDArray[np.float64]

LOW, HIGH = 0.1, 0.9  # the quantiles of the band
MOST_PARTS, LEAST_DRAWS = 40, 20  # parts of a range, and draws in each
PARTS_AT_LEAST = 3
POINTS = 400  # single draws of a method that are shown


def marginals(plan: Plan, runs: pl.DataFrame) -> tuple[Tabs, ...]:
    """Charts of a scenario's runs, see `read_runs`, for each field that varies; none where none has enough draws."""
    charts = ((field, tuple(_charts(plan, runs, field))) for field in varied_fields(plan))
    choices = tuple((field, some) for field, some in charts if some)
    about = "How the results depend on each number that varies from draw to draw, whatever the others are."
    return (Tabs("Over what varies", choices, about),) if choices else ()


def _charts(plan: Plan, runs: pl.DataFrame, field: str) -> Iterator[Chart]:
    """Errors, NEES and failures over a field."""
    log = any(one.log for one in plan.ranges if one.field == field)
    unit = field_at(path_of(field), Scenario).unit
    how: dict[str, Any] = {"x_label": f"{field} in {unit}" if unit else field, "log_x": log, "timed": False}
    known = runs.filter(pl.col(field).is_not_null())
    draws = known.filter(pl.col("method").to_physical() == 0)
    edges = _edges(draws[field])
    if edges is None:
        return
    labels = {label: known.filter(pl.col("method") == label) for label in plan.methods}
    errors = [one for label, rows in labels.items() for one in _errors(label, rows, field, edges)]
    x, middle, *_ = _quantiles(draws[field], 1e3 * draws["bound"], edges)
    if np.isfinite(middle).any():
        errors.append(Series("Cramér–Rao bound", x, middle, style="dashed"))
    about = (
        f"RMSE of the path of each draw: the median in {len(edges) - 1} parts of equally many draws, and the band that "
        f"holds {100 * (HIGH - LOW):.0f} % of them. Points are single draws."
    )
    yield Chart(f"Error against {field}", about, "RMSE of the path in mm", tuple(errors), log=True, **how)
    normalised = tuple(one for label, rows in labels.items() for one in _nees(label, rows, field, edges))
    if normalised:
        low, high = nees_band(max(1, len(draws) // (len(edges) - 1)))
        about = "Mean NEES at the middle frame in the same parts; between the lines in 95 % of parts by chance."
        levels = ((low, "2.5 %"), (high, "97.5 %"))
        yield Chart(f"NEES against {field}", about, "eᵀ P⁻¹ e", normalised, log=True, levels=levels, **how)
    lost = tuple(_lost(label, rows, field, edges) for label, rows in labels.items())
    if any(np.nansum(one.y) for one in lost):
        about = "The share of draws that gave no result, or one that was announced as not to be trusted."
        yield Chart(f"Without a trusted result, against {field}", about, "share of the draws", lost, **how)


def _edges(values: pl.Series) -> FloatArray | None:
    """The limits of parts with equally many draws; None where there are too few draws or only one value."""
    parts = min(MOST_PARTS, len(values) // LEAST_DRAWS)
    if parts < PARTS_AT_LEAST:
        return None
    edges = np.unique(np.quantile(values.to_numpy(), np.linspace(0, 1, parts + 1)))
    return edges if len(edges) > PARTS_AT_LEAST else None


def _parts(x: pl.Series, edges: FloatArray) -> NDArray[np.intp]:
    """For each value the part that it is in."""
    return np.clip(np.searchsorted(edges, x.to_numpy(), side="right") - 1, 0, len(edges) - 2)


def _quantiles(x: pl.Series, y: pl.Series, edges: FloatArray) -> Sequence[FloatArray]:
    """Median of x, and median, low and high quantile of y in each part that has some; NaN where it has none."""
    found = (
        pl.DataFrame({"part": _parts(x, edges), "x": x, "y": y})
        .group_by("part")
        .agg(
            pl.col("x").median(),
            pl.col("y").median().alias("middle"),
            pl.col("y").quantile(LOW, "linear").alias("low"),
            pl.col("y").quantile(HIGH, "linear").alias("high"),
        )
        .sort("part")
    )
    return [found[name].cast(pl.Float64).fill_null(float("nan")).to_numpy() for name in ("x", "middle", "low", "high")]


def _errors(label: str, rows: pl.DataFrame, field: str, edges: FloatArray) -> Iterator[Series]:
    rows = rows.filter(pl.col("failure").is_null() & pl.col("rmse").is_not_null())
    if rows.is_empty():
        return
    x, middle, low, high = _quantiles(rows[field], 1e3 * rows["rmse"], edges)
    yield Series(label, x, middle, COLOURS[label], low=low, high=high)
    some = rows.gather_every(max(1, -(-len(rows) // POINTS)))
    values = some[field].to_numpy(), 1e3 * some["rmse"].to_numpy()
    yield Series(f"{label}, draws", *values, COLOURS[label], "points", shown=False)


def _nees(label: str, rows: pl.DataFrame, field: str, edges: FloatArray) -> Iterator[Series]:
    rows = rows.filter(pl.col(NEES[1]).is_not_null())
    if not rows.is_empty():
        yield _means(label, rows[field], rows[NEES[1]], edges)


def _lost(label: str, rows: pl.DataFrame, field: str, edges: FloatArray) -> Series:
    lost = rows["failure"].is_not_null() | rows["trustworthy"].not_().fill_null(False)
    return _means(label, rows[field], lost.cast(pl.Float64), edges)


def _means(label: str, x: pl.Series, y: pl.Series, edges: FloatArray) -> Series:
    """The mean of y in each part, over the median of x."""
    parts = pl.DataFrame({"part": _parts(x, edges), "x": x, "y": y}).group_by("part")
    found = parts.agg(pl.col("x").median(), pl.col("y").mean()).sort("part")
    return Series(label, found["x"].to_numpy(), found["y"].to_numpy(), COLOURS[label])
