"""Figures of the path: the polynomial through the pseudo-intersections, and the error of what comes out."""

from typing import TYPE_CHECKING

import numpy as np

from baryscope.models.words import counted, length
from baryscope.study.figures.run import BEST, FREE, IN_LVLH, PUBLISHED, PaperRun
from baryscope.study.methods import COLOURS
from baryscope.study.pictures import INK, PALETTE, shade_blackouts

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def fit(run: PaperRun) -> "Figure":
    """Pseudo-intersections, the polynomial through them, and the true path, in C."""
    from matplotlib.figure import Figure

    stages, tracks, truth = run.published, run.flight.tracks, run.true_path
    at = stages.motion.time[stages.frames]
    path = stages.path(tracks.time)
    figure = Figure(figsize=(9, 6), dpi=110, layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for axis, panel in enumerate(panels):
        middle = stages.crossings.middle[:, axis]
        panel.plot(at, middle, ".", ms=1, color=PALETTE[0], label="pseudo-intersections")
        panel.plot(tracks.time, truth[:, axis], color=INK, lw=2, label="truth")
        panel.plot(tracks.time, path[:, axis], color=PALETTE[3], lw=1.2, label="polynomial")
        shown = np.concatenate([truth[:, axis], path[:, axis], np.nanquantile(middle, [0.02, 0.98])])
        room = 0.1 * float(np.ptp(shown))
        panel.set_ylim(float(shown.min()) - room, float(shown.max()) + room)
        panel.set_ylabel(f"{'xyz'[axis]} in m")
        panel.grid(alpha=0.25)
        shade_blackouts(panel, tracks.time, tracks.seen)
    panels[0].set_xlim(tracks.time[0], tracks.time[-1])
    panels[-1].set_xlabel("time in s")
    handles, words = panels[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=4, fontsize=8, frameon=False, markerscale=6)
    return figure


def of_fit(run: PaperRun) -> str:
    """What the polynomial is, how well it fits, and how little that says."""
    stages, outcome = run.published, run.outcome(PUBLISHED)
    seen = run.flight.tracks.seen.any(axis=1)
    error = np.linalg.norm(stages.path(run.flight.tracks.time) - run.true_path, axis=1)
    at = np.sqrt(np.mean(error[seen] ** 2))
    words = (
        f"The polynomial has degree {stages.path.degree}, which cross-validation chose, goes through "
        f"{counted(int(stages.crossings.valid.sum()) - stages.path.rejected, 'pseudo-intersection')} and leaves "
        f"{length(stages.path.rms)} rms per coordinate. "
        f"It is {length(float(at))} off where features are seen"
    )
    if not seen.all():
        words += f", {length(float(np.sqrt(np.mean(error[~seen] ** 2))))} where none is"
    return (
        f"{words}. The paper shows how the polynomial fits the pseudo-intersections; ours has the truth beside them. "
        "Noise scatters about the truth, the bias does not: the residuals of the fit do not show that it is "
        f"{length(outcome.rmse or 0.0)} off over the whole run."
    )


def error(run: PaperRun) -> "Figure":
    """Errors over time: of the published method, of the same in LVLH axes, of pivot and ml, and the bound."""
    from matplotlib.figure import Figure

    tracks, bound = run.flight.tracks, run.bound
    figure = Figure(figsize=(9, 4.6), dpi=110, layout="constrained")
    panel = figure.subplots()
    names = {PUBLISHED: "as published", IN_LVLH: "as published, in LVLH axes", FREE: FREE, BEST: BEST}
    for label, words in names.items():
        outcome = run.outcome(label)
        if outcome.error is not None:
            panel.semilogy(tracks.time, outcome.error, color=PALETTE[COLOURS[label]], lw=1.2, label=words)
    if bound is not None:
        least = np.sqrt(np.trace(bound.position_covariance, axis1=1, axis2=2))
        panel.semilogy(bound.time, least, color=INK, lw=1.4, ls="--", label="Cramér–Rao bound")
    shade_blackouts(panel, tracks.time, tracks.seen)
    panel.set_xlim(tracks.time[0], tracks.time[-1])
    panel.set_ylim(1e-5, None)
    panel.set_xlabel("time in s")
    panel.set_ylabel("error of the centre of mass in m")
    panel.grid(alpha=0.25)
    handles, words_ = panel.get_legend_handles_labels()
    figure.legend(handles, words_, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def of_error(run: PaperRun) -> str:
    """The errors over the whole run, and what is possible."""
    values = {label: length(run.outcome(label).rmse or 0.0) for label in (PUBLISHED, IN_LVLH, FREE, BEST)}
    words = (
        f"As published the method is off by {values[PUBLISHED]} rms. Turned into LVLH axes before the registration, "
        "where a held chaser is at rest, "
        f"the same steps are off by {values[IN_LVLH]}. `pivot`, which solves for the path and the attitudes at once, "
        f"is off by {values[FREE]}, and "
        f"`ml`, which knows that the tumble is free, by {values[BEST]}"
    )
    return words + ("." if run.bound is None else f"; the Cramér–Rao bound is {length(run.bound.position_deviation)}.")
