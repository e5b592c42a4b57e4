"""The files of a flown loop: tracks, orbit and commands, truth, estimate, a summary, a report and a picture."""

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from baryscope.estimator.geometry.symmetric import elements_of
from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS
from baryscope.models.files import AnyPath, write_together
from baryscope.models.scenario.orbit import orbit_text
from baryscope.report import html_of
from baryscope.study.flight import write_truth
from baryscope.study.loop import Loop
from baryscope.study.loop_report import marks_of, report_of_loop
from baryscope.study.loop_summary import summary_of
from baryscope.study.pictures import pictures_possible, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRACKS, ORBIT, THRUST = "tracks.csv", "tracks.orbit.toml", "tracks.acceleration.csv"
TRUTH, ESTIMATE, SUMMARY = "truth.csv", "estimate.csv", "flight.json"
REPORT, PICTURE = "report.html", "flight.png"


def loop_paths(folder: AnyPath) -> tuple[Path, ...]:
    """The files that a flight may have."""
    return tuple(Path(folder) / name for name in (TRACKS, ORBIT, THRUST, TRUTH, ESTIMATE, SUMMARY, REPORT, PICTURE))


def write_loop(loop: Loop, folder: AnyPath, options: dict[str, Any]) -> tuple[Path, ...]:
    """Write tracks.csv, truth.csv, estimate.csv, flight.json, report.html and, with matplotlib, flight.png.

    Beside the tracks are tracks.orbit.toml and tracks.acceleration.csv, as `baryscope estimate` takes them.

    Args:
        loop: the flight.
        folder: where to.
        options: of the flight, which stand in flight.json.

    Returns:
        The files.

    Raises:
        InputError: a file cannot be written.
    """
    *written, picture = loop_paths(folder)
    tracks, orbit, thrust, truth, estimate, summary, report = written
    found = summary_of(loop)
    page = html_of(report_of_loop(loop, found, options))
    text = json.dumps(found | {"options": options}, indent=2, allow_nan=False)
    write_together(
        {
            tracks: loop.tracks.write_rows,
            orbit: lambda stream: stream.write(orbit_text(loop.orbit.of_simulation())),
            thrust: lambda stream: _write_thrust(loop, stream),
            truth: lambda stream: write_truth(loop.truth, stream),
            estimate: lambda stream: _write_estimate(loop, stream),
            summary: lambda stream: stream.write(text + "\n"),
            report: lambda stream: stream.write(page),
        }
    )
    if not pictures_possible():
        return tuple(written)
    save(loop_figure(loop), picture)
    return *written, picture


def _write_thrust(loop: Loop, stream: TextIO) -> None:
    """The commands, LVLH: each acts from the communication point at which it stands in the outputs until the next."""
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", "ax", "ay", "az"])
    writer.writerows(np.column_stack([loop.time, loop.command]).tolist())


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
