"""Figures of what the chaser sees: the features that it follows, the relative trajectory, and a cluster made rigid."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.registration.intervals import Interval, runs_of
from baryscope.estimator.registration.procrustes import Registration
from baryscope.models.words import counted, length
from baryscope.study.figures.run import PaperRun, lag_of
from baryscope.study.pictures import INK, PALETTE, shade_blackouts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

SHOWN = 300  # frames of a cluster that are drawn


def bars(run: PaperRun) -> "Figure":
    """A bar for each feature while it is followed."""
    from matplotlib.figure import Figure

    tracks = run.flight.tracks
    figure = Figure(figsize=(9, 0.9 + 0.28 * len(tracks.labels)), dpi=110, layout="constrained")
    panel = figure.subplots()
    step = float(np.median(np.diff(tracks.time)))
    for row, label in enumerate(tracks.labels):
        spans = [
            (tracks.time[a], tracks.time[b - 1] - tracks.time[a] + step)
            for a, b in runs_of(tracks.seen[:, row]).tolist()
        ]
        panel.broken_barh(spans, (row - 0.35, 0.7), color=PALETTE[5])
        where: dict[str, Any] = {"transform": panel.get_yaxis_transform(), "ha": "right", "va": "center"}
        panel.text(-0.01, row, label, fontsize=9, parse_math=False, **where)
    panel.set_yticks([])
    panel.set_ylim(len(tracks.labels) - 0.5, -0.5)
    shade_blackouts(panel, tracks.time, tracks.seen)
    panel.set_xlim(tracks.time[0], tracks.time[-1])
    panel.set_xlabel("time in s; nothing is seen where it is shaded")
    return figure


def of_bars(run: PaperRun) -> str:
    """How many features make how many clusters."""
    tracks = run.flight.tracks
    clusters = len(run.published.motion.intervals)
    dark = np.mean(~tracks.seen.any(axis=1))
    most = int(tracks.seen.sum(axis=1).max())
    features = [set(interval.features) for interval in run.published.motion.intervals]
    shared = sum(sum(k in one for one in features) > 1 for k in range(len(tracks.labels)))
    tied = f"{shared} of the features are in more than one, by which `pivot` and `ml` tie clusters together"
    if not shared:
        tied = "none of the features is in more than one"
    return (
        f"{counted(len(tracks.labels), 'feature')}, {most} at most at a time, make {counted(clusters, 'cluster')}; "
        "nothing is seen in "
        f"{100 * dark:.0f} % of the frames. The paper's bars have such clusters and blackouts, too, and its method "
        f"starts anew with each; ours show that {tied}."
    )


def trajectory(run: PaperRun) -> "Figure":
    """The chaser about the target in LVLH axes, and the centre of mass as the chaser sees it."""
    from matplotlib.figure import Figure

    time, path = run.flight.truth.time, run.path_in_L
    figure = Figure(figsize=(9, 3.6), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.5))
    left.plot(path[:, 1], path[:, 0], color=PALETTE[5], lw=1.5)
    left.plot(path[0, 1], path[0, 0], "o", color=PALETTE[5], ms=5, label="chaser at the start")
    left.plot(0, 0, "+", color=INK, ms=9, mew=1.5, label="target's centre of mass")
    left.margins(0.15)
    left.set_aspect("equal", "datalim")
    left.set_xlabel("along-track in m")
    left.set_ylabel("radial in m")
    left.legend(fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.2))
    for axis, name in enumerate("xyz"):
        right.plot(time, run.true_path[:, axis], color=PALETTE[(5, 4, 2)[axis]], lw=1.4, label=name)
    right.set_xlim(time[0], time[-1])
    right.set_xlabel("time in s")
    right.set_ylabel("centre of mass in C, m")
    right.legend(fontsize=8, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.14))
    for panel in (left, right):
        panel.grid(alpha=0.25)
    return figure


def of_trajectory(run: PaperRun) -> str:
    """At rest in one frame, moving in the other."""
    moved = float(np.linalg.norm(run.path_in_L - run.path_in_L[0], axis=1).max())
    speed = float(np.linalg.norm(run.flight.truth["target.velocity"], axis=1).mean())
    lag = lag_of(run.published)
    return (
        "The paper shows the relative trajectory as what is to be found; ours, in two frames, shows what its method "
        f"leaves out of account. In LVLH axes the chaser moves by {length(moved)} at most. In the chaser's own axes, "
        f"which do not turn, the centre of mass moves at {1000 * speed:.3g} mm/s, {length(lag * speed)} in the "
        f"{lag:g} s from pose to pose over which the published method takes it to be at rest."
    )


def rigid(run: PaperRun) -> "Figure":
    """Errors of the features of the longest cluster, as measured and as registered; distances between two of them."""
    from matplotlib.figure import Figure

    interval, fitted = _longest(run)
    raw, registered = _errors(run, interval, fitted)
    time = run.flight.tracks.time[interval.frames]
    shown = slice(0, SHOWN)
    figure = Figure(figsize=(9, 5), dpi=110, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for values, colour, label in ((raw, PALETTE[2], "measured"), (registered, PALETTE[5], "registered")):
        size = np.sqrt(np.nanmean(values**2, axis=(1, 2)))
        upper.plot(time[shown], 1e3 * size[shown], color=colour, lw=0.9, label=label)
    upper.set_ylabel("rms error of a feature, mm")
    one, two = _pair(run, interval)
    between = np.linalg.norm(
        run.flight.tracks.position[interval.frames, one] - run.flight.tracks.position[interval.frames, two], axis=1
    )
    where = list(interval.features)
    shape = fitted.shape[[where.index(one), where.index(two)]]
    lower.plot(time[shown], between[shown], color=PALETTE[2], lw=0.7)
    lower.axhline(np.linalg.norm(shape[0] - shape[1]), color=PALETTE[5], lw=1.5)
    names = run.flight.tracks.labels
    lower.set_ylabel(f"{names[one]} to {names[two]}, m", fontsize=8, parse_math=False)
    lower.set_xlabel("time in s")
    lower.set_xlim(*time[shown][[0, -1]])
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=2, fontsize=8, frameon=False)
    for panel in (upper, lower):
        panel.grid(alpha=0.25)
    return figure


def of_rigid(run: PaperRun) -> str:
    """How much of the noise the registration takes away."""
    interval, fitted = _longest(run)
    raw, registered = (float(np.sqrt(np.nanmean(values**2))) for values in _errors(run, interval, fitted))
    points = round(float(np.mean(run.flight.tracks.seen[interval.frames].sum(axis=1))))
    return (
        f"Registered, the features of the longest cluster ({interval.length} frames) are a rigid body, and off by "
        f"{length(registered)} rms for {length(raw)} as measured: a factor of {registered / raw:.2f}. A pose has 6 "
        "unknowns "
        f"for the {3 * points} coordinates of {points} features, which leaves √(6/{3 * points}) = "
        f"{np.sqrt(2 / points):.2f} of the noise: that of the "
        "pose, which all features share, and which no registration takes away."
    )


def _longest(run: PaperRun) -> tuple[Interval, Registration]:
    motion = run.published.motion
    return max(zip(motion.intervals, motion.registrations, strict=True), key=lambda one: one[0].length)


def _errors(run: PaperRun, interval: Interval, fitted: Registration) -> tuple[FloatArray, FloatArray]:
    """Errors of the features' coordinates, as measured and as registered, (frames, features, 3), m; NaN where not "
    "seen."""
    columns = list(interval.features)
    true = run.flight.truth["features"][interval.frames][:, columns]
    measured = run.flight.tracks.position[interval.frames][:, columns] - true
    registered = np.where(np.isfinite(measured), fitted.rigid_points - true, np.nan)
    return measured, registered


def _pair(run: PaperRun, interval: Interval) -> tuple[int, int]:
    """The two features of the interval that are seen most often."""
    seen = run.flight.tracks.seen[interval.frames].sum(axis=0)
    order = sorted(interval.features, key=lambda feature: -int(seen[feature]))
    return order[0], order[1]
