"""`baryscope bound`: how well the centre of mass could be found at best, before anything is flown."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from cyclopts import Parameter

from baryscope.estimator.bound import cramer_rao_bound
from baryscope.estimator.prose import verdict
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.scripts.cli.console import out, step
from baryscope.study.bound_picture import draw_bound
from baryscope.study.bound_table import (
    Cell,
    cells_of,
    grid,
    noise_of,
    path_tables,
    rigs_of,
    variant_of,
    write_csv,
    write_markdown,
)
from baryscope.study.pictures import pictures_possible

DURATIONS = "60,120,300,600,1200"  # s, of the table unless given
RANGES = "10,20,40,80"  # m
RATES = "0.5,1,2,4"  # deg/s

Number = TypeVar("Number", bound=float)


def bound(
    *,
    scenario: str = "envisat",
    durations: str | None = None,
    ranges: str | None = None,
    rates: str | None = None,
    features: str | None = None,
    baselines: str | None = None,
    trajectory: str | None = None,
    table: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Compute the Cramér–Rao bound of a scenario, or of its variants: how long to look, from where, with which rig.

    Without lists, the bound of the scenario itself; with lists, a table over all their combinations. What has no list
    stays as the scenario has it, but --table or -o without any list takes a usual set of durations, rates and, where
    the noise depends on it, ranges.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    durations
        Durations of the run, s, separated by commas.
    ranges
        Distances of the chaser at the start, m; position and velocity are scaled to them.
    rates
        Tumble rates, degrees per second; the angular rate is scaled to them.
    features
        How many features there are: the first so many of the scenario.
    baselines
        Of the stereo rig, m; the scenario must have one.
    trajectory
        What is known of the path: fixed, polynomial:N, or relative-orbit, which it is unless given.
    table
        Print the table even if no list is given.
    output
        A folder for the table as bound.csv and bound.md, and its picture.
    """
    base = load_scenario(scenario)
    own = variant_of(base)
    given = (features, baselines, rates, ranges, durations)
    if output is not None and output.exists() and not output.is_dir():
        raise InputError(f"{output}: is a file, expected a folder to write to")
    if all(one is None for one in given):
        if not table and output is None:
            _print_own(base, trajectory)
            return
        durations = DURATIONS
        rates = RATES if own.rate else None
        ranges = None if base.sensor.stereo is None else RANGES
    if rates is not None and own.rate == 0:
        raise InputError("--rates: found with a target that does not turn, expected an angular rate to scale")
    if baselines is not None and own.baseline is None:
        raise InputError("--baselines: found with a scenario without sensor.stereo, expected one that has a rig")
    counts = _numbers("features", features, own.features, int)
    if not 3 <= min(counts) <= max(counts) <= own.features:
        raise InputError(f"--features: found {features}, expected 3 to the scenario's {own.features}")
    variants = grid(
        counts,
        [None] if own.baseline is None else _numbers("baselines", baselines, own.baseline, float),
        _numbers("rates", rates, own.rate, float),
        _numbers("ranges", ranges, own.range, float),
        _numbers("durations", durations, own.duration, float),
    )
    with step(f"bounds of {len(variants)} variants") as report:
        cells = cells_of(base, variants, trajectory, report)
    for one in path_tables(base.name, cells):
        out.print(one)
    for line in _notes(cells):
        out.print(line, soft_wrap=True)
    if output is not None:
        _write(base, trajectory, cells, output)


def _numbers(name: str, text: str | None, own: Number, kind: Callable[[str], Number]) -> list[Number]:
    """The numbers of a list, rising; the scenario's own without one."""
    if text is None:
        return [own]
    what = "whole numbers" if name == "features" else "numbers"
    try:
        values = [kind(item) for item in text.split(",") if item.strip()]
    except ValueError:
        values = []
    if not values or not all(math.isfinite(value) and value > 0 for value in values):
        raise InputError(f"--{name}: found {text!r}, expected {what} above 0, separated by commas")
    return sorted(set(values))


def _print_own(scenario: Scenario, trajectory: str | None) -> None:
    """The bound of the scenario itself, in a few lines."""
    with step("Cramér–Rao bound"):
        found = cramer_rao_bound(scenario, trajectory=trajectory)
    lines = [
        f"{scenario.name}: {scenario.duration:.0f} s at {1 / scenario.run.sample_time:g} Hz, {found.observations} "
        f"sightings of {len(scenario.features.points)} features, {noise_of(scenario)}, "
        f"path {trajectory or 'relative-orbit'}",
        f"  path of the centre of mass   ±{1000 * found.position_deviation:.3g} mm",
        f"  centre of mass in body axes  ±{1000 * found.offset_deviation:.3g} mm",
        f"  attitude                     ±{np.rad2deg(found.attitude_deviation):.3g}°",
        f"  angular rate                 ±{np.rad2deg(found.rate_deviation):.3g} °/s",
        f"  inertia over its trace       ±{found.inertia_deviation:.3g}",
        f"  centre of mass {verdict(found.observability)}",
    ]
    out.print("\n".join(lines), soft_wrap=True)


def _notes(cells: Sequence[Cell]) -> list[str]:
    """What the words in the table mean, if there are some."""
    words = {cell.in_short for cell in cells}
    notes = []
    if "axis hidden" in words:
        notes.append("axis hidden: the centre of mass is not observable along one axis")
    if "hidden" in words:
        notes.append("hidden: the centre of mass is not observable")
    reasons = dict.fromkeys(cell.reason for cell in cells if cell.bound is None)
    return notes + [f"none: {reason}" for reason in reasons]


def _write(scenario: Scenario, trajectory: str | None, cells: Sequence[Cell], folder: Path) -> None:
    """The table as CSV and Markdown, and a picture for each rig."""
    pictures = []
    if pictures_possible():
        rigs = list(rigs_of(cells))
        for rig, of_rig in rigs:
            words = rig.replace(",", "").replace(" ", "-")
            pictures.append(folder / ("bound.png" if len(rigs) == 1 else f"bound-{words}.png"))
            draw_bound(f"{scenario.name}, {rig}", of_rig, pictures[-1])
    write_csv(cells, folder / "bound.csv")
    write_markdown(scenario, trajectory or "relative-orbit", cells, pictures, folder / "bound.md")
    out.print(f"More in {folder / 'bound.md'} and {folder / 'bound.csv'}", soft_wrap=True)
