"""The tables and the picture of the approaches: miss and error over time, and how each loop ends."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baryscope.study.approach.flying import ARRIVED, LOOPS
from baryscope.study.population.consistency import WRONG
from baryscope.study.population.running import Line
from baryscope.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

MARKS = (150.0, 300.0, 450.0, 600.0, 750.0, 900.0)  # s, of the first table
BAND = (0.1, 0.5, 0.9)  # quantiles
WORDS = {
    "online": "online estimator",
    "online-scale": "online, thrust 3 % too strong",
    "online-pointing": "online, thrust 2° off",
    "online-execution": "online, each push 1 % and 0.5° off",
    "pivot": "pivot, every 10 s",
    "screw-gpa-lvlh": "published method, LVLH axes",
    "screw-gpa": "published method",
}
COLOURS = {
    "online": "#264ee4",
    "online-scale": "#6a4c93",
    "online-pointing": "#8d99ae",
    "online-execution": "#3d5a40",
    "pivot": "#2a9d8f",
    "screw-gpa-lvlh": "#e09f3e",
    "screw-gpa": "#d1495b",
}
LEAST = 1e-5  # m, the lower end of the picture


def over_time(lines: Sequence[Line]) -> Table:
    """A row for each loop and mark: medians of miss and error, and where the middle 80 % of the draws lie."""
    rows = []
    for label, group in _groups(lines).items():
        time = _column(group, "time")[0]
        bands = [_band(_column(group, "miss")), 1e3 * _band(_column(group, "error"))]
        for mark in MARKS:
            if mark <= time[-1]:
                k = int(np.argmin(np.abs(time - mark)))
                cells = [cell for band in bands for cell in _cells(band[:, k])]
                rows.append((WORDS[label], f"{time[k]:.0f}", *cells))
    headings = ("loop", "time s", "miss m", "10–90 %", "error of the CoM mm", "10–90 %")
    return Table(headings, tuple(rows))


def ends(lines: Sequence[Line]) -> Table:
    """A row for each loop: how many draws arrive and stay, when, and what the worst one does."""
    rows = []
    for label, group in _groups(lines).items():
        arrived = [line["arrived"] for line in group if line["arrived"] is not None]
        body = [line["body_error"] for line in group if line["body_error"] is not None]
        miss, error = (_column(group, name)[:, -1] for name in ("miss", "error"))
        rows.append(
            (
                WORDS[label],
                str(len(group)),
                str(len(arrived)),
                f"{np.median(arrived):.0f}" if arrived else "-",
                *(_figures(value) for value in (np.median(miss), miss.max())),
                *(_figures(1e3 * value) for value in (np.nanmedian(error), np.nanmax(error))),
                _figures(1e3 * float(np.median(body))) if body else "-",
                f"{np.median([line['velocity_change'] for line in group]):.1f}",
                str(sum(line["refused"] for line in group)),
                *_claims(group),
            )
        )
    headings = (
        f"loop, draws, within {ARRIVED:g} m for good, after s (median), miss at the end m, worst, "
        "error at the end mm, worst, mean in body axes mm, commands m/s, runs refused, NEES (median), wrong %"
    )
    return Table(tuple(headings.split(", ")), tuple(rows))


def _claims(group: Sequence[Line]) -> tuple[str, str]:
    """The median NEES over draws and times, and the part of these, in %, whose claims are wrong."""
    nees = [value for line in group for value in line.get("nees") or () if value is not None]
    if not nees:
        return "-", "-"
    return _figures(float(np.median(nees))), _figures(100 * float(np.mean(np.array(nees) > WRONG)))


def picture(lines: Sequence[Line]) -> "Figure":
    """Miss and error over time: the median of the draws of each loop, and the band of the middle 80 %."""
    from matplotlib.figure import Figure

    groups = _groups(lines)
    figure = Figure(figsize=(9, 7), dpi=120, layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    for panel, name in zip(panels, ("miss", "error"), strict=True):
        for label, group in groups.items():
            low, middle, high = _band(_column(group, name))
            time, colour = _column(group, "time")[0], COLOURS[label]
            panel.fill_between(time, np.maximum(low, LEAST), high, color=colour, alpha=0.2, lw=0)
            panel.semilogy(time, middle, color=colour, lw=1.8, label=WORDS[label])
        panel.grid(alpha=0.3)
        panel.set_xlim(0, None)
    panels[0].set_ylabel("chaser from its goal, m")
    panels[1].set_ylabel("error of the centre of mass, m")
    panels[1].set_xlabel("time in s")
    count = max(len(group) for group in groups.values())
    panels[0].set_title(f"Median and middle 80 % of {count} draws", fontsize=10)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure


def _groups(lines: Sequence[Line]) -> dict[str, list[Line]]:
    """The lines of each loop, but for flights that failed."""
    flown = [line for line in lines if "failure" not in line]
    groups = {label: [line for line in flown if line["loop"] == label] for label in LOOPS}
    return {label: group for label, group in groups.items() if group}


def _column(group: Sequence[Line], name: str) -> FloatArray:
    """Values over time, (draws, times), NaN where there is none."""
    return np.array([line[name] for line in group], dtype=np.float64)


def _band(values: FloatArray) -> FloatArray:
    """The quantiles (3, times) over the draws that have a value; NaN where none has."""
    band = np.full((len(BAND), values.shape[1]), np.nan)
    known = np.isfinite(values).any(axis=0)
    band[:, known] = np.nanquantile(values[:, known], BAND, axis=0)
    return band


def _cells(band: FloatArray) -> tuple[str, str]:
    if not np.isfinite(band).all():
        return "-", "-"
    low, middle, high = map(_figures, band)
    return middle, f"{low}–{high}"


def _figures(value: float) -> str:
    """A number in two significant figures, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"
