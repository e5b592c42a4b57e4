"""The picture of a table of bounds: the bound on path RMSE over the duration, for each range and tumble rate."""

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from baryscope.study.bounds import Cell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3  # panels side by side at most
TICKS = 8  # durations at most that are all named on the axis


def bound_figure(name: str, cells: Sequence[Cell]) -> "Figure":
    """The bound on path RMSE over the duration: a panel for each rate, a line for each range.

    Both axes are logarithmic. What is not observable is left out; a cross at the panel's lower edge says so.
    """
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    of_rates = [(rate, list(group)) for rate, group in groupby(cells, lambda cell: cell.variant.rate)]
    columns = 2 if len(of_rates) == 4 else min(len(of_rates), COLUMNS)
    rows = -(-len(of_rates) // columns)
    figure = Figure(figsize=(1.5 + 3.5 * columns, 0.8 + 3 * rows), dpi=120, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    ranges = sorted({cell.variant.range for cell in cells})
    durations = sorted({cell.variant.duration for cell in cells})
    colour = dict(zip(ranges, colormaps["viridis"](np.linspace(0, 0.85, len(ranges))), strict=True))
    for panel, (rate, of_rate) in zip(panels, of_rates, strict=False):
        panel.set_xscale("log")
        panel.set_yscale("log")
        if len(durations) <= TICKS:
            panel.set_xticks(durations, [f"{value:.6g}" for value in durations], minor=False)
            panel.set_xticks([], minor=True)
        for distance, group in groupby(of_rate, lambda cell: cell.variant.range):
            line = list(group)
            duration = np.array([cell.variant.duration for cell in line])
            value = np.array(
                [cell.bound.position_deviation if cell.bound and cell.observable else np.nan for cell in line]
            )
            label = f"{distance:g} m"
            panel.plot(duration, value, marker="o", ms=3.5, lw=1.4, color=colour[distance], label=label)
            hidden = duration[np.isnan(value)]
            edge = panel.get_xaxis_transform()
            panel.plot(hidden, np.full(len(hidden), 0.03), "x", ms=6, color=colour[distance], transform=edge)
        panel.set_title(f"{rate:.3g} °/s", fontsize=10)
        panel.grid(alpha=0.25, which="both")
    for panel in panels[len(of_rates) :]:
        panel.set_visible(False)
    for panel in panels[max(0, len(of_rates) - columns) : len(of_rates)]:
        panel.set_xlabel("duration in s")
        panel.tick_params(labelbottom=True)
    for panel in panels[::columns]:
        panel.set_ylabel("path RMSE in m")
    panels[0].legend(title="range", fontsize=8, title_fontsize=8)
    figure.suptitle(f"Cramér–Rao bound of the centre of mass: {name}", fontsize=10, parse_math=False)
    return figure
