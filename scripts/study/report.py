"""The table of a comparison, and the summary that is kept of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table

from baryscope.estimator.bound import Bound
from baryscope.estimator.prose import summary
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.files import replacing
from baryscope.models.scenario import Scenario
from baryscope.scripts.cli.console import VERSION

HEADINGS = ("method", "axes or path", "rms, mm", "max, mm", "own, mm", "seen", "time")


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method made of the tracks.

    Attributes:
        method: its name in the list of methods.
        axes: axes in which it registered the tracks, or the kind of path that it assumed.
        stem: stem of the names of its files.
        estimate: the result; None where the method could not be carried out.
        error: (n,), distance from the true CoM at every time, m.
        failure: why there is no result.
    """

    method: str
    axes: str
    stem: str
    estimate: Estimate | None = None
    error: NDArray[np.float64] | None = None
    failure: str = ""

    @property
    def title(self) -> str:
        """The method and its axes, in words."""
        return (
            f"{self.method}, {self.axes} axes" if self.axes in ("inertial", "lvlh") else f"{self.method}, {self.axes}"
        )

    def cells(self) -> tuple[str, ...]:
        """Its row in the table."""
        if self.estimate is None or self.error is None:
            return (self.method, self.axes, "-", "-", "-", "-", "-")
        predicted = self.estimate.predicted_rmse
        return (
            self.method,
            self.axes,
            _millimetres(np.sqrt(np.mean(self.error**2))),
            _millimetres(self.error.max()),
            "-" if predicted is None else _millimetres(predicted),
            f"{100 * self.estimate.coverage:.0f} %",
            f"{self.estimate.wall_time:.2f} s",
        )


def _millimetres(metres: float) -> str:
    return f"{1000 * metres:.2f}"


def bound_cells(bound: Bound) -> tuple[str, ...]:
    """The bound's row in the table."""
    worst = float(np.sqrt(np.trace(bound.position_covariance, axis1=1, axis2=2).max()))
    return (
        "Cramér–Rao bound",
        "relative-orbit",
        _millimetres(bound.position_deviation),
        _millimetres(worst),
        "-",
        "-",
        "-",
    )


def outcome_table(scenario: Scenario, outcomes: list[Outcome], bound: Bound | None) -> Table:
    """The comparison as a table for the terminal."""
    title = f"Error of the centre of mass, {scenario.name}, {scenario.duration:.0f} s"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in HEADINGS[:2] else "right", no_wrap=True)
    for outcome in outcomes:
        table.add_row(*outcome.cells())
    if bound is not None:
        table.add_section()
        table.add_row(*bound_cells(bound))
    return table


def write_summary(
    scenario: Scenario, tracks: FeatureTracks, outcomes: list[Outcome], bound: Bound | None, path: Path
) -> None:
    """Write a comparison as Markdown: what was flown, the table, and what each method chose."""
    rows = [outcome.cells() for outcome in outcomes] + ([bound_cells(bound)] if bound is not None else [])
    picture = ["![errors of all methods](comparison.png)", ""] if (path.parent / "comparison.png").exists() else []
    lines = [
        f"# {scenario.name}: {scenario.description}",
        "",
        f"Made by baryscope {VERSION}: {tracks.time.size} frames over {tracks.time[-1]:.0f} s, "
        f"{int(tracks.seen.sum())} sightings of {len(tracks.labels)} features, {_noise(scenario)}, "
        f"seed {scenario.run.seed}.",
        f"Nothing was seen in {100 * np.mean(~tracks.seen.any(axis=1)):.0f} % of the frames; errors are taken at "
        "all of them.",
        "",
        "| " + " | ".join(HEADINGS) + " |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
        *("| " + " | ".join(row) + " |" for row in rows),
        "",
        *picture,
        "rms and max are those of the error over all frames, own the rms error that the method's covariance says, seen "
        "the share of the frames at which the method has an attitude of its own to go by.",
    ]
    for outcome in outcomes:
        lines += ["", f"## {outcome.title}", "", *_details(outcome, (path.parent / f"{outcome.stem}.png").exists())]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _noise(scenario: Scenario) -> str:
    rig = scenario.sensor.stereo
    if rig is None:
        return f"noise {scenario.sensor.noise:g} m per axis"
    return f"noise {rig.pixel_noise:g} px of a rig with {rig.baseline:g} m baseline and f = {rig.focal_length:g} px"


def _details(outcome: Outcome, pictured: bool) -> list[str]:
    if outcome.estimate is None:
        return [f"Could not be carried out: {outcome.failure}."]
    picture = [f"![path and error]({outcome.stem}.png)", ""] if pictured else []
    return [
        *picture,
        *(f"- {line}" for line in summary(outcome.estimate)),
        f"- files: {outcome.stem}.csv, {outcome.stem}.json",
    ]
