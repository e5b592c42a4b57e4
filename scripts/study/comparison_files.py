"""The files of a comparison: tracks, truth, orbit, estimates, pictures, a report and a summary in Markdown."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from baryscope import __version__
from baryscope.estimator.document.files import write_estimate
from baryscope.estimator.prose import summary
from baryscope.models.files import AnyPath, replacing
from baryscope.models.scenario import Scenario
from baryscope.progress import Progress, stage
from baryscope.report import write_report
from baryscope.study.comparison import Comparison, Outcome
from baryscope.study.comparison_report import report_of_comparison
from baryscope.study.flight import flight_paths, write_flight
from baryscope.study.pictures import comparison_figure, outcome_figure, pictures_possible, save

TRACKS, REPORT = "tracks.csv", "report.html"


def comparison_paths(folder: AnyPath, labels: Iterable[str]) -> tuple[Path, ...]:
    """The files that a comparison of the methods of these labels may have."""
    folder = Path(folder)
    names = ["comparison.png", "summary.md", REPORT]
    names += [f"{label}{suffix}" for label in labels for suffix in (".csv", ".json", ".png")]
    return *flight_paths(folder / TRACKS), *(folder / name for name in names)


def write_comparison(comparison: Comparison, folder: AnyPath, progress: Progress | None = None) -> Path:
    """Write tracks with truth and orbit, each method's estimate, pictures, report.html and summary.md.

    Pictures are left out where matplotlib is not installed.

    Returns:
        The summary.

    Raises:
        InputError: a file cannot be written.
    """
    flight, folder = comparison.flight, Path(folder)
    with stage(progress, "writing tracks, truth and estimates"):
        write_flight(flight, folder / TRACKS)
        for outcome in comparison.outcomes:
            if outcome.estimate is not None:
                write_estimate(outcome.estimate, folder / f"{outcome.label}.csv")
    with stage(progress, "writing the report"):
        write_report(report_of_comparison(comparison), folder / REPORT)
    pictures: list[str] = []
    if pictures_possible():
        with stage(progress, "drawing"):
            save(comparison_figure(comparison), folder / "comparison.png")
            pictures.append("comparison.png")
            for outcome in comparison.outcomes:
                if outcome.estimate is not None:
                    save(outcome_figure(flight, outcome), folder / f"{outcome.label}.png")
                    pictures.append(f"{outcome.label}.png")
    path = folder / "summary.md"
    with replacing(path) as temporary:
        temporary.write_text(summary_text(comparison, pictures), encoding="utf-8")
    return path


def summary_text(comparison: Comparison, pictures: list[str]) -> str:
    """A comparison as Markdown: what is flown, the table, and what each method chose."""
    scenario, tracks = comparison.scenario, comparison.flight.tracks
    lines = [
        f"# {scenario.name}: {scenario.description}",
        "",
        f"Made by baryscope {__version__}: {tracks.time.size} frames over {tracks.time[-1]:.0f} s, "
        f"{int(tracks.seen.sum())} observations of {len(tracks.labels)} features, {_noise(scenario)}, "
        f"seed {scenario.run.seed}.",
        f"Nothing is seen in {100 * np.mean(~tracks.seen.any(axis=1)):.0f} % of the frames; errors are taken at "
        f"all of them. [{REPORT}]({REPORT}) shows it in 3D and over time, in any browser.",
        "",
        comparison.table().markdown(),
        "",
        *_picture("comparison.png", "errors of all methods", pictures),
        "RMSE and max are those of the error over all frames. The predicted RMSE is what the method's covariance says. "
        "Coverage is the share of the frames at which the method has an attitude to go by.",
    ]
    if comparison.doubts:
        lines += ["", comparison.doubts]
    for outcome in comparison.outcomes:
        lines += ["", f"## {outcome.title}", "", *_details(outcome, pictures)]
    return "\n".join(lines) + "\n"


def _noise(scenario: Scenario) -> str:
    rig = scenario.sensor.stereo
    if rig is None:
        return f"noise {scenario.sensor.noise:g} m per axis"
    return f"noise {rig.pixel_noise:g} px of a rig with {rig.baseline:g} m baseline and f = {rig.focal_length:g} px"


def _picture(name: str, words: str, pictures: list[str]) -> list[str]:
    return [f"![{words}]({name})", ""] if name in pictures else []


def _details(outcome: Outcome, pictures: list[str]) -> list[str]:
    if outcome.estimate is None:
        return [f"Could not be carried out: {outcome.failure}."]
    return [
        *_picture(f"{outcome.label}.png", "path and error", pictures),
        *(f"- {line}" for line in summary(outcome.estimate)),
        f"- files: {outcome.label}.csv, {outcome.label}.json",
    ]
