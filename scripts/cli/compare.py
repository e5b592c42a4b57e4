"""`baryscope compare`: the main job, from the scenario to a table, pictures and files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from baryscope.estimator.bound import Bound, cramer_rao_bound
from baryscope.estimator.document import write_estimate
from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import ScrewOptions
from baryscope.fmu import build_fmu
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import Scenario, load_scenario, write_orbit
from baryscope.scripts.cli.console import err, out, step
from baryscope.scripts.cli.simulate import Flight, fly, write_truth
from baryscope.study.pictures import draw_comparison, draw_outcome, pictures_possible
from baryscope.study.report import Outcome, outcome_table, write_summary


def compare(
    *,
    scenario: str = "envisat",
    methods: str = ",".join(METHODS),
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Build the unit, fly the scenario, estimate with every method, and compare with the truth.

    Writes tracks, truth and estimates as CSV, a picture of all errors and one per method, the unit and a summary.md.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    methods
        Methods to compare, separated by commas; screw-gpa runs in inertial and in LVLH axes.
    output
        The folder to write to; out/ and the scenario's name unless given.
    """
    chosen = _chosen(methods)
    flown = load_scenario(scenario)
    folder = output or Path("out") / flown.name
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, expected a folder to write to")
    with step("building the unit"):
        unit = build_fmu(flown, folder / "TumblingTarget.fmu")
    with step(f"simulating {flown.duration:.0f} s at {1 / flown.run.sample_time:g} Hz") as report:
        flight = fly(flown, unit, report)
    with step("writing tracks and truth"):
        flight.tracks.write_csv(folder / "tracks.csv")
        write_truth(flight.truth, folder / "tracks.truth.csv")
        write_orbit(flown.orbit, folder / "orbit.toml")
    outcomes = [_run(name, axes, flown, flight, folder) for name, axes in chosen]
    bound = _bound(flown)
    if pictures_possible():
        draw_comparison(flown, flight.tracks, outcomes, bound, folder / "comparison.png")
    out.print(outcome_table(flown, outcomes, bound))
    write_summary(flown, flight.tracks, outcomes, bound, folder / "summary.md")
    out.print(f"\nMore in {folder / 'summary.md'}", soft_wrap=True)
    if not any(outcome.estimate for outcome in outcomes):
        raise ComputationError(f"no method could be carried out; the first says: {outcomes[0].failure}")


def _chosen(methods: str) -> list[tuple[str, str]]:
    """Pairs of method and axes to run; no axes for methods that have none."""
    names = [name.strip() for name in methods.split(",") if name.strip()]
    unknown = [name for name in names if name not in METHODS]
    if unknown or not names:
        found = repr(unknown[0]) if unknown else "none"
        raise InputError(f"--methods: found {found}, expected some of {', '.join(METHODS)}")
    return [(name, axes) for name in dict.fromkeys(names) for axes in _axes_of(name)]


def _axes_of(method: str) -> Sequence[str]:
    if METHODS[method].options is not ScrewOptions:
        return ("",)
    return ("inertial", "lvlh") if method == "screw-gpa" else ("inertial",)


def _run(method: str, axes: str, scenario: Scenario, flight: Flight, folder: Path) -> Outcome:
    """Estimate by one method, write its files, and measure its error."""
    stem = f"{method}-lvlh" if axes == "lvlh" else method
    options = ScrewOptions(axes="lvlh" if axes == "lvlh" else "inertial") if axes else None
    with step(f"estimating by {method}" + (f" in {axes} axes" if axes else "")):
        try:
            result = estimate(flight.tracks, method=method, orbit=scenario.orbit, options=options)
        except ComputationError as failure:
            err.print(f"{method}: {failure}", soft_wrap=True)
            return Outcome(method, axes or "-", stem, failure=str(failure))
    write_estimate(result, folder / f"{stem}.csv")
    true_path = flight.truth["target.position"]
    kind = axes or result.path
    outcome = Outcome(method, kind, stem, result, np.linalg.norm(result.position - true_path, axis=1))
    if pictures_possible():
        draw_outcome(scenario, flight.tracks, true_path, outcome, folder / f"{stem}.png")
    return outcome


def _bound(scenario: Scenario) -> Bound | None:
    """The Cramér–Rao bound, where the scenario has one."""
    try:
        with step("Cramér–Rao bound"):
            return cramer_rao_bound(scenario)
    except (ComputationError, InputError) as reason:
        err.print(f"no bound: {reason}", soft_wrap=True)
        return None
