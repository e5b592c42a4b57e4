"""The tables of a campaign, for the terminal and as Markdown."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table

from baryscope.models.files import replacing
from baryscope.models.words import counted
from baryscope.study.campaign.folder import Run
from baryscope.study.campaign.plan import Entry, Plan
from baryscope.study.campaign.statistics import Row, Striking, bound_of, nees_band, rows_of, striking

SHORT = ("method", "rms", "own", "/bound", "±", "target", "NEES", "mid", "end", "body", "fail", "time")
HEADINGS = (
    "method", "rms, mm", "own, mm", "rms / bound", "±", "target", "NEES, start", "middle", "end", "in body axes",
    "failed", "time, s",
)  # fmt: skip
MOST_STRIKING = 60  # draws to list


def campaign_tables(plan: Plan, runs: Mapping[tuple[str, int], Run]) -> Iterator[Table | str]:
    """For the terminal: a table for each scenario that has runs, and what to know of them."""
    for entry in plan.entries:
        rows = rows_of(entry, plan, runs)
        if not rows[0].draws:
            continue
        yield f"{entry.name}: {entry.data.get('description', '')}, {counted(rows[0].draws, 'draw')}"
        table = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=0)
        for heading in SHORT:
            table.add_column(heading, justify="left" if heading == "method" else "right", no_wrap=True)
        for cells in _all_cells(entry, rows, runs):
            table.add_row(*cells)
        yield table
        yield ""
    yield _about_nees(plan, runs)
    found = striking(plan, runs)
    if found:
        yield f"remarks on single draws: {len(found)}, see summary.md"


def write_summary(plan: Plan, runs: Mapping[tuple[str, int], Run], path: Path) -> None:
    """Write a campaign as Markdown: what was run, a table for each scenario, and the draws to look at."""
    total = len(plan.entries) * plan.draws
    missing = "" if len(runs) == total else f" {total - len(runs)} of {counted(total, 'run')} still missing."
    varied = {
        ("attitude", "anomaly"): "attitude (uniform over all rotations), place on the orbit and noise",
        ("attitude",): "attitude (uniform over all rotations) and noise",
        ("anomaly",): "place on the orbit and noise",
    }.get(plan.vary, "noise")
    lines = [
        "# Campaign",
        "",
        f"Made by baryscope {plan.version} (program {plan.program}):",
        "",
        f"    {plan.command}",
        "",
        f"{counted(plan.draws, 'draw')} of each scenario, each with its own {varied}.{missing}",
        "",
    ]
    for entry in plan.entries:
        rows = rows_of(entry, plan, runs)
        lines += [f"## {entry.name}", "", f"{entry.data.get('description', '')} (hash {entry.digest})".strip(), ""]
        lines += markdown(HEADINGS, _all_cells(entry, rows, runs)) if rows[0].draws else ["No runs yet."]
        lines.append("")
    lines += [*_legend(plan, runs), "", *_striking_lines(striking(plan, runs))]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def markdown(headings: Iterable[str], rows: Iterable[tuple[str, ...]]) -> list[str]:
    """The lines of a table in Markdown, its first column to the left."""
    names = list(headings)
    ruler = ["---", *["---:"] * (len(names) - 1)]
    return ["| " + " | ".join(row) + " |" for row in (names, ruler, *rows)]


def _all_cells(entry: Entry, rows: list[Row], runs: Mapping[tuple[str, int], Run]) -> list[tuple[str, ...]]:
    """The table's rows, the bound's last; with loss is that of what outliers leave."""
    reference, lossy = bound_of(entry, runs)
    empty = ("",) * (len(HEADINGS) - 2)
    cells = [_cells(row) for row in rows] + [("bound", _millimetres(reference), *empty)]
    if reference is not None and lossy != reference:
        cells.append(("with loss", _millimetres(lossy), *empty))
    return cells


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.method,
        _millimetres(row.rms),
        _millimetres(row.own),
        _number(row.ratio),
        _number(row.ratio_error),
        "" if row.target is None else f"{row.target:g} {'ok' if row.reached else 'no'}",
        *(_nees(value, row.draws - row.failed) for value in (*row.nees, row.offset_nees)),
        f"{row.failed}+{row.unsettled}" if row.unsettled else str(row.failed),
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


def _about_nees(plan: Plan, runs: Mapping[tuple[str, int], Run]) -> str:
    draws = max(sum(key[0] == entry.name for key in runs) for entry in plan.entries)
    low, high = nees_band(draws)
    usual = f"{low:.2f} to {high:.2f} in 95 % of campaigns of {counted(draws, 'draw')}"
    return f"NEES should be 3: {usual}; ! marks what is outside."


def _legend(plan: Plan, runs: Mapping[tuple[str, int], Run]) -> list[str]:
    return [
        "rms is the root of the mean squared error of the path over all frames and draws, own the same as the",
        "covariances of the methods have it. bound is the root of the mean squared Cramér–Rao bound of the same draws",
        "without outliers, with loss that of what outliers leave. rms / bound has ± as its standard error; target is",
        "what it should be at most. NEES is the mean of eᵀ P⁻¹ e of the position at the first, the middle and the last",
        "frame, and of the centre of mass in body axes (those that the features of the longest cluster hold).",
        _about_nees(plan, runs),
        "failed: how many draws gave no result, + how many did not converge. time is the median, with one thread.",
    ]


def _striking_lines(found: list[Striking]) -> list[str]:
    if not found:
        return ["No single draw failed, did not converge or is off by more than chance allows."]
    more = [f"- and {len(found) - MOST_STRIKING} more"] if len(found) > MOST_STRIKING else []
    return [
        "## Draws to look at",
        "",
        *(f"- {one.scenario} {one.case}, {one.method}: {one.what}" for one in found[:MOST_STRIKING]),
        *more,
    ]
