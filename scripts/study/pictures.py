"""Pictures of a comparison, as matplotlib figures: a notebook shows them, `save` writes them."""

from importlib.util import find_spec
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, replacing
from baryscope.models.words import length
from baryscope.report.charts import expected_error
from baryscope.report.gaps import blackouts
from baryscope.report.page import palette
from baryscope.study.comparison import Comparison, Outcome
from baryscope.study.flight import Flight
from baryscope.study.methods import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK, _ESTIMATE, _SHADE = "#333333", "#d1495b", "#e9e9ee"
PALETTE = palette()


def pictures_possible() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def save(figure: "Figure", path: AnyPath) -> None:
    """Write a figure as PNG; equal figures give equal files.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def outcome_figure(flight: Flight, outcome: Outcome) -> "Figure":
    """The true and the estimated path in C, and the error on a logarithmic scale, with what the covariance expects.

    Raises:
        InputError: the method has no result.
    """
    from matplotlib.figure import Figure

    if outcome.estimate is None or outcome.error is None:
        raise InputError(f"{outcome.label}: has no result to draw ({outcome.failure})")
    tracks, true_path = flight.tracks, flight.true_path
    time = tracks.time
    figure = Figure(figsize=(9, 7.5), dpi=120, layout="constrained")
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(1, 1, 1, 1.6))
    for axis, (panel, name) in enumerate(zip(panels[:3], "xyz", strict=True)):
        panel.plot(time, true_path[:, axis], color=INK, lw=2.5, label="truth")
        panel.plot(time, outcome.estimate.position[:, axis], color=_ESTIMATE, lw=1, label="estimate")
        panel.set_ylabel(f"{name} in m")
    panels[3].semilogy(time, np.maximum(outcome.error, 1e-9), color=_ESTIMATE, lw=1)
    if outcome.estimate.covariance is not None:
        band = np.maximum(expected_error(outcome.estimate.covariance), 1e-9)
        panels[3].fill_between(time, *band, color=_ESTIMATE, alpha=0.15, lw=0, label="95 % by the covariance")
    panels[3].axhline(outcome.rmse, color=INK, lw=0.8, ls="--", label=f"RMSE {outcome.rmse:.3g} m")
    panels[3].set_ylabel("error in m")
    panels[3].set_xlabel("time in s")
    for panel in panels:
        shade_blackouts(panel, time, tracks.seen)
        panel.set_xlim(time[0], time[-1])
        panel.grid(alpha=0.25)
    named = {word: handle for panel in panels for handle, word in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=5, frameon=False)
    title = f"{flight.scenario.name}: centre of mass by {outcome.title} (frame C; blackouts shaded)"
    figure.suptitle(fill(title, 90), parse_math=False)
    return figure


def comparison_figure(comparison: Comparison) -> "Figure":
    """The errors of all methods over time on a logarithmic scale, the bound among them; blackouts are shaded.

    Each error lies on the band that holds 95 % of the errors by the method's own covariance. A curve that a later one
    covers is drawn broad and pale.
    """
    from matplotlib.figure import Figure

    tracks, bound, scenario = comparison.flight.tracks, comparison.bound, comparison.scenario
    time = tracks.time
    figure = Figure(figsize=(9, 6), dpi=120, layout="constrained")
    panel = figure.subplots()
    for outcome in comparison.outcomes:
        if outcome.error is None or outcome.rmse is None or outcome.estimate is None:
            continue
        colour = PALETTE[COLOURS[outcome.label]]
        how = {"lw": 5, "alpha": 0.4} if comparison.hidden(outcome) else {"lw": 1.2}
        panel.semilogy(time, outcome.error, color=colour, label=f"{outcome.title}: RMSE {length(outcome.rmse)}", **how)
        if outcome.estimate.covariance is not None:
            panel.fill_between(time, *expected_error(outcome.estimate.covariance), color=colour, alpha=0.12, lw=0)
    if bound is not None:
        least = np.sqrt(np.trace(bound.position_covariance, axis1=1, axis2=2))
        label = f"Cramér–Rao bound on path RMSE: {length(bound.position_deviation)}"
        panel.semilogy(bound.time, least, color=INK, lw=1.6, ls="--", label=label)
    shade_blackouts(panel, time, tracks.seen)
    panel.set_xlim(time[0], time[-1])
    low, high = panel.get_ylim()
    panel.set_ylim(max(low, 1e-5), high)
    panel.set_xlabel("time in s")
    panel.set_ylabel("error of the centre of mass in m")
    panel.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    title = f"{fill(f'{scenario.name}: {scenario.description}', 110)}\nBands: 95 % by each method's covariance"
    panel.set_title(title, fontsize=10, parse_math=False)
    return figure


def shade_blackouts(panel: Any, time: NDArray[np.float64], seen: NDArray[np.bool_]) -> None:
    """Shade where nothing is seen."""
    for k, (begin, end) in enumerate(blackouts(time, seen)):
        panel.axvspan(begin, end, color=_SHADE, lw=0, zorder=0, label="nothing seen" if k == 0 else None)
