"""The table of a comparison, and the summary that is kept of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.files import replacing
from baryscope.models.scenario import Orbit, Scenario
from baryscope.scripts.console import VERSION

HEADINGS = ("method", "axes", "rms error", "largest error", "covered", "wall time")


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method made of the tracks.

    Attributes:
        method: its name in the list of methods.
        axes: axes in which it registered the tracks.
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

    def cells(self) -> tuple[str, ...]:
        """Its row in the table."""
        if self.estimate is None or self.error is None:
            return (self.method, self.axes, "-", "-", "-", "-")
        facts = self.estimate.diagnostics
        return (
            self.method,
            self.axes,
            f"{np.sqrt(np.mean(self.error**2)):.4f} m",
            f"{self.error.max():.4f} m",
            f"{100 * facts['covered_share']:.0f} %",
            f"{facts['wall_time']:.2f} s",
        )


def outcome_table(scenario: Scenario, outcomes: list[Outcome]) -> Table:
    """The comparison as a table for the terminal."""
    table = Table(
        title=f"Error of the centre of mass, {scenario.name}, {scenario.duration:.0f} s", title_justify="left"
    )
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("method", "axes") else "right", no_wrap=True)
    for outcome in outcomes:
        table.add_row(*outcome.cells())
    return table


def write_summary(scenario: Scenario, tracks: FeatureTracks, outcomes: list[Outcome], path: Path) -> None:
    """Write a comparison as Markdown: what was flown, the table, and what each method chose."""
    lines = [
        f"# {scenario.name}: {scenario.description}",
        "",
        f"Made by baryscope {VERSION}: {tracks.time.size} frames over {tracks.time[-1]:.0f} s, "
        f"{int(tracks.seen.sum())} sightings of {len(tracks.labels)} features, noise {scenario.sensor.noise:g} m "
        f"per axis, seed {scenario.run.seed}.",
        f"Nothing was seen in {100 * np.mean(~tracks.seen.any(axis=1)):.0f} % of the frames; errors are taken at "
        "all of them.",
        "",
        "| " + " | ".join(HEADINGS) + " |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
        *("| " + " | ".join(outcome.cells()) + " |" for outcome in outcomes),
        "",
        "Covered is the share of the frames at which the method has a position of its own, not the polynomial's alone.",
    ]
    for outcome in outcomes:
        lines += [
            "",
            f"## {outcome.method}, {outcome.axes} axes",
            "",
            *_details(outcome, (path.parent / f"{outcome.stem}.png").exists()),
        ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _details(outcome: Outcome, pictured: bool) -> list[str]:
    if outcome.estimate is None:
        return [f"Could not be carried out: {outcome.failure}."]
    facts = outcome.estimate.diagnostics
    chosen = facts["options"]
    own = ", ".join(chosen["chosen_from_data"]) or "none"
    picture = [f"![path and error]({outcome.stem}.png)", ""] if pictured else []
    return [
        *picture,
        f"- lag {chosen['lag']:g} s, cut-off {chosen['cutoff']:.3g} Hz, degree {chosen['degree']} "
        f"(chosen from the data: {own})",
        f"- rms of the registration {facts['residual_rms']:.4f} m, of the path's fit {facts['fit_rms']:.4f} m, "
        f"of the segments between successive axes {facts['segment_length_rms']:.4f} m",
        f"- files: {outcome.stem}.csv, {outcome.stem}.json",
    ]


def write_orbit(orbit: Orbit, path: Path) -> None:
    """Write an orbit file, as `baryscope estimate --orbit` reads it."""
    rows = [f"{name} = {value!r}" for name, value in orbit.model_dump().items()]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(["[orbit]", *rows]) + "\n", encoding="utf-8")
