"""The files of a flown loop: tracks, truth, estimate, a summary, a report and a picture."""

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from baryscope import __version__
from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS
from baryscope.models.approach.reckoning import RECKONING, RETREAT
from baryscope.models.files import AnyPath, write_together
from baryscope.models.sensor.navigation import STATUSES
from baryscope.report import html_of
from baryscope.study.flight import write_truth
from baryscope.study.loop import Loop
from baryscope.study.loop_report import marks_of, report_of_loop
from baryscope.study.pictures import pictures_possible, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRACKS, TRUTH, ESTIMATE, SUMMARY = "tracks.csv", "truth.csv", "estimate.csv", "flight.json"
REPORT, PICTURE = "report.html", "flight.png"


def loop_paths(folder: AnyPath) -> tuple[Path, ...]:
    """The files that a flight may have."""
    return tuple(Path(folder) / name for name in (TRACKS, TRUTH, ESTIMATE, SUMMARY, REPORT, PICTURE))


def summary_of(loop: Loop) -> dict[str, Any]:
    """What came of a flight, in SI units; None where there is no value.

    The second half of the flight counts for errors and NEES, which is of 3 degrees of freedom; the last tenth for the
    largest miss. untracked is for how long the estimator, once it had tracked the target, did not, untracked_since from
    when on at last; reckoned and retreated for how long the controller was in these modes, retreating_since from when
    on at last, None of one without modes. nearest is to the centre of mass, nearest_feature to any feature; inside for
    how long the chaser was in the features' convex hull.
    """
    half = slice(len(loop.time) // 2, None)
    known = loop.tracking[half]
    step = float(loop.time[0])
    before = np.flatnonzero(loop.tracking)
    moded, retreats = bool(np.isfinite(loop.mode).any()), loop.mode == RETREAT
    on_course = np.flatnonzero(~retreats)

    def first(flags: Any) -> float | None:
        return float(loop.time[np.argmax(flags)]) if flags.any() else None

    def rms(values: Any) -> float | None:
        return float(np.sqrt(np.mean(values[half][known] ** 2))) if known.any() else None

    return {
        "version": __version__,
        "duration": float(loop.time[-1]),
        "step": step,
        "samples": len(loop.tracks.time),
        "tracking_since": first(loop.tracking),
        "tumble_known_since": first(loop.tumble),
        "synchronised_since": first(loop.synchronised),
        "tracking_share": float(known.mean()),
        "untracked": float((~loop.tracking[before[0] :]).sum() * step) if before.size else None,
        "untracked_since": float(loop.time[before[-1] + 1]) if before.size and not loop.tracking[-1] else None,
        "reckoned": float((loop.mode == RECKONING).sum() * step) if moded else None,
        "retreated": float(retreats.sum() * step) if moded else None,
        "retreating_since": float(loop.time[on_course[-1] + 1]) if retreats[-1] else None,
        "position_rmse": rms(loop.error),
        "claimed_rmse": rms(loop.deviation),
        "mean_nees": float(loop.nees[half][known].mean()) if known.any() else None,
        "largest_miss": float(loop.miss[-max(1, len(loop.time) // 10) :].max()),
        "last_miss": float(loop.miss[-1]),
        "nearest": float(np.linalg.norm(loop.chaser, axis=1).min()),
        "nearest_feature": float(loop.clearance.min()),
        "inside": float(loop.inside.sum() * step),
        "inside_since": first(loop.inside),
        "velocity_change": float(np.linalg.norm(loop.command, axis=1).sum() * step),
        "status": STATUSES[loop.status[-1]],
    }


def write_loop(loop: Loop, folder: AnyPath, options: dict[str, Any]) -> tuple[Path, ...]:
    """Write tracks.csv, truth.csv, estimate.csv, flight.json, report.html and, with matplotlib, flight.png.

    Args:
        loop: the flight.
        folder: where to.
        options: of the flight, which stand in flight.json.

    Returns:
        The files.

    Raises:
        InputError: a file cannot be written.
    """
    tracks, truth, estimate, summary, report, picture = loop_paths(folder)
    found = summary_of(loop)
    page = html_of(report_of_loop(loop, found, options))
    text = json.dumps(found | {"options": options}, indent=2, allow_nan=False)
    write_together(
        {
            tracks: loop.tracks.write_rows,
            truth: lambda stream: write_truth(loop.truth, stream),
            estimate: lambda stream: _write_estimate(loop, stream),
            summary: lambda stream: stream.write(text + "\n"),
            report: lambda stream: stream.write(page),
        }
    )
    if not pictures_possible():
        return tracks, truth, estimate, summary, report
    save(loop_figure(loop), picture)
    return tracks, truth, estimate, summary, report, picture


def _write_estimate(loop: Loop, stream: TextIO) -> None:
    """The online estimate as `baryscope estimate` writes one; cells are empty while the estimator waits."""
    upper = elements_of(loop.covariance)
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", "x", "y", "z", *COVARIANCE_COLUMNS])
    for time, status, position, covariance in zip(
        loop.time.tolist(), loop.status, loop.position.tolist(), upper.tolist(), strict=True
    ):
        writer.writerow([time, *([*position, *covariance] if status else [""] * 9)])


def loop_figure(loop: Loop) -> "Figure":
    """Error and claim of the CoM, how far the chaser is from target and goal, and the command over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 8), dpi=120, layout="constrained")
    error, place, push = figure.subplots(3, 1, sharex=True, height_ratios=(1.4, 1.4, 1))
    error.semilogy(loop.time, loop.error, color="#264ee4", lw=1, label="error of the centre of mass")
    error.semilogy(loop.time, loop.deviation, color="#333333", lw=1, ls="--", label="claimed, 1σ")
    error.set_ylabel("m")
    place.semilogy(loop.time, np.linalg.norm(loop.chaser, axis=1), color="#333333", lw=1, label="range")
    place.semilogy(loop.time, np.maximum(loop.miss, 1e-4), color="#d1495b", lw=1, label="chaser from its goal")
    place.set_ylabel("m")
    push.plot(loop.time, 1e3 * np.linalg.norm(loop.command, axis=1), color="#2a9d8f", lw=1, label="command")
    push.set_ylabel("mm/s²")
    push.set_xlabel("time in s")
    marks = marks_of(loop)
    for panel in (error, place, push):
        panel.grid(alpha=0.3)
        for time, _ in marks:
            panel.axvline(time, color="#999999", lw=0.8, ls=":")
        panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    for height, (time, word) in enumerate(marks):
        error.annotate(
            f" {word}", (time, 0.95 - 0.08 * height), xycoords=("data", "axes fraction"), fontsize=8, color="#555555"
        )
    return figure
