"""Figures of the screw axes: two that pass each other, how far they miss, and what the low-pass does to them."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.screws import Stages
from baryscope.models.words import length
from baryscope.study.figures.run import PaperRun, errors_of, lag_of, sampling_time
from baryscope.study.pictures import INK, PALETTE, shade_blackouts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

MARGIN = 1.15  # of the picture of two axes, about what it must show
TOUCHING = 2e-3  # m, below which the paper takes a segment for a sign of accuracy
ABOVE: dict[str, Any] = {"fontsize": 8, "frameon": False, "loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}


def crossing(run: PaperRun) -> "Figure":
    """Two successive axes seen along their common normal, without noise; the lengths of all segments, and the "
    "errors."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
    _two_axes(left, run.exact, run.true_path)
    tracks = run.flight.tracks
    lag, step = lag_of(run.exact), sampling_time(run.exact)
    time = [stages.motion.time[stages.frames] for stages in (run.exact, run.brief)]
    right.semilogy(time[0], run.exact.crossings.length, ".", color=PALETTE[5], ms=1.5, label=f"segment, lag {lag:g} s")
    right.semilogy(time[1], run.brief.crossings.length, ".", color=PALETTE[2], ms=1.5, label=f"segment, lag {step:g} s")
    right.semilogy(time[1], errors_of(run.brief, run.true_path), ".", color=INK, ms=1.5, label=f"error, lag {step:g} s")
    right.set_ylim(1e-5, None)
    right.set_xlim(tracks.time[0], tracks.time[-1])
    right.set_xlabel("time in s")
    right.set_ylabel("m")
    right.grid(alpha=0.25)
    right.legend(markerscale=6, columnspacing=0.8, handletextpad=0.1, ncols=3, **ABOVE)
    shade_blackouts(right, tracks.time, tracks.seen)
    return figure


def _two_axes(panel: Any, stages: Stages, true_path: FloatArray) -> None:
    """The two successive axes in the middle of the run, their pseudo-intersection, and the centre of mass."""
    valid = np.flatnonzero(stages.crossings.valid)
    pair = int(valid[len(valid) // 2])
    axes = stages.axes.axis[[stages.one[pair], stages.two[pair]]]
    beside = true_path[stages.frames[pair]] - stages.crossings.middle[pair]
    along = axes.sum(axis=0) / np.linalg.norm(axes.sum(axis=0))
    across = np.cross(np.cross(axes[0], axes[1]), along)
    across /= np.linalg.norm(across)
    half = MARGIN * float(np.linalg.norm(beside))
    for axis, colour, label in zip(axes, (PALETTE[5], PALETTE[4]), ("axis", "next axis"), strict=True):
        ends = np.outer([-2 * half, 2 * half], axis)
        panel.plot(ends @ along, ends @ across, color=colour, lw=1.5, label=label)
    panel.plot(0, 0, "o", color=PALETTE[3], ms=6, label="pseudo-intersection")
    panel.plot(beside @ along, beside @ across, "+", color=INK, ms=11, mew=2, label="centre of mass")
    panel.set_xlim(-half, half)
    panel.set_ylim(-half, half)
    panel.set_aspect("equal", "box")
    panel.set_xlabel("along the axes, m")
    panel.set_ylabel("across them, m")
    panel.legend(ncols=2, **ABOVE)


def of_crossing(run: PaperRun) -> str:
    """Lengths of the segments against errors of their middles."""
    long, short = (float(np.nanmedian(stages.crossings.length)) for stages in (run.exact, run.brief))
    error = errors_of(run.brief, run.true_path)
    words = (
        f"Without any noise the shortest segments between successive axes have a median length of {length(long)} for "
        f"the lag of {lag_of(run.exact):g} s that suits the noise, and of {length(short)} for "
        f"{lag_of(run.brief):g} s, but their middles are {length(float(np.nanmedian(error)))} off."
    )
    touching = run.brief.crossings.length < TOUCHING
    if touching.any():
        words += (
            f" The paper takes segments below {1000 * TOUCHING:g} mm as a sign that the axes meet in the centre of "
            "mass; "
            f"ours of that kind meet {length(float(np.median(error[touching])))} beside it (median)."
        )
    return words + " A short segment says that two axes agree, not that they are right."


def against_velocity(run: PaperRun) -> "Figure":
    """Distances of axes and pseudo-intersections from the centre of mass against ‖v⊥‖, without noise."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), dpi=110, layout="constrained")
    panels = figure.subplots(1, 2, sharex=True)
    slope = float(np.median(np.concatenate([one.expected / one.velocity for one in run.misses])))
    most = max(float(one.velocity.max()) for one in run.misses)
    words = ("axis from the centre of mass, m", "pseudo-intersection from it, m")
    for panel, name, ordinate in zip(panels, ("axis", "middle"), words, strict=True):
        for one, colour in zip(run.misses, (4, 5, 2, 3), strict=True):
            found, label = getattr(one, name), f"{one.distance:.3g} m away"
            panel.plot(1e3 * one.velocity, found, ".", ms=1.5, color=PALETTE[colour], label=label)
        panel.plot([0, 1e3 * most], [0, slope * most], color=INK, lw=1, ls="--", label="‖v⊥‖ Δt/(2 tan(θ/2))")
        highest = max(float(np.quantile(getattr(one, name), 0.99)) for one in run.misses)
        panel.set_ylim(0, 1.1 * max(highest, slope * most))
        panel.set_xlabel("‖v⊥‖ in mm/s")
        panel.set_ylabel(ordinate)
        panel.grid(alpha=0.25)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, markerscale=6, fontsize=8, frameon=False)
    return figure


def of_velocity(run: PaperRun) -> str:
    """By what factor the error exceeds that of the axis."""
    expected, axis, middle = (
        np.concatenate([getattr(one, name) for one in run.misses]) for name in ("expected", "axis", "middle")
    )
    ratio, total = float(np.median(axis / expected)), float(np.median(middle / axis))
    near, far = run.misses[0], run.misses[-1]
    return (
        f"The error is no noise. Without any, the axis misses the centre of mass by {ratio:.2f} times what theory says "
        "(median), ‖v⊥‖ Δt/(2 tan(θ/2)) for a lag Δt in which the body turns by θ; the pseudo-intersection slides "
        "along "
        f"the axes besides, and is {total:.1f} times as far off. It grows with the distance that the chaser keeps, "
        "from "
        f"{length(float(np.median(near.middle)))} at {near.distance:.3g} m to {length(float(np.median(far.middle)))} "
        "at "
        f"{far.distance:.3g} m (medians). Neither more features nor a better camera changes it."
    )


def filtered(run: PaperRun) -> "Figure":
    """The angle of the axes to the true angular rate: of three raw features, registered, and filtered."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.4), dpi=110, layout="constrained")
    panel = figure.subplots()
    for (label, time, angle), colour in zip(_angles(run), (PALETTE[0], PALETTE[2], PALETTE[5], INK), strict=True):
        panel.semilogy(time, np.maximum(np.rad2deg(angle), 1e-6), ".", ms=1.5, color=colour, label=label)
    shade_blackouts(panel, run.flight.tracks.time, run.flight.tracks.seen)
    panel.set_xlim(run.flight.tracks.time[0], run.flight.tracks.time[-1])
    panel.set_xlabel("time in s")
    panel.set_ylabel("from the mean rotation's axis, degrees")
    panel.grid(alpha=0.25)
    handles, words = panel.get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=4, markerscale=6, fontsize=8, frameon=False)
    return figure


def of_filtered(run: PaperRun) -> str:
    """How far the axes are off, rms."""
    raw, registered, smooth, exact = (f"{np.rad2deg(np.sqrt(np.mean(angle**2))):.2g}°" for _, _, angle in _angles(run))
    return (
        f"Axes from three raw features are off by {raw} rms, those of registered clusters by {registered}, and by "
        f"{smooth} after the zero-phase low-pass, which turns the axis of a tumble by {exact} where there is no noise. "
        "Procrustes analysis and the filter do what the paper says; it is not for them that the centre of mass is "
        "missed."
    )


def _angles(run: PaperRun) -> list[tuple[str, FloatArray, FloatArray]]:
    """Label, times and angles in rad of axes to those of noiseless screws of the same lag."""
    exact = run.exact
    true = np.full((len(exact.motion.time), 3), np.nan)
    ok = exact.screws.valid
    true[exact.pairs.first[ok]] = exact.screws.axis[ok]
    series = []
    for label, stages in (("three raw features", run.raw), ("registered", run.published)):
        if stages.pairs.lag == exact.pairs.lag:
            sound = stages.screws.valid
            series.append(_turned(label, stages, stages.screws.axis[sound], stages.pairs.first[sound], true))
    series.append(
        _turned("registered and filtered", run.published, run.published.axes.axis, run.published.axes.first, true)
    )
    series.append(_turned("filtered, without noise", exact, exact.axes.axis, exact.axes.first, true))
    return series


def _turned(
    label: str, stages: Stages, axis: FloatArray, first: NDArray[np.intp], true: FloatArray
) -> tuple[str, FloatArray, FloatArray]:
    known = np.isfinite(true[first, 0])
    sine = np.linalg.norm(np.cross(axis[known], true[first[known]]), axis=1)
    return label, stages.motion.time[first[known]], np.arcsin(np.minimum(sine, 1.0))
