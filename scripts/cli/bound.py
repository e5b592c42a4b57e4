"""`baryscope bound`: the Cramér–Rao bound of a scenario, from its truth and noise alone."""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from cyclopts import Parameter

from baryscope.estimator.bound import Bound, cramer_rao_bound
from baryscope.estimator.camera.rig import load_rig
from baryscope.estimator.prose import verdict
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs
from baryscope.models.scenario import Scenario, load_scenario, scenario_path
from baryscope.models.variables import Force
from baryscope.progress import stage
from baryscope.scripts.cli.console import Show
from baryscope.study.bound_files import bound_paths, noise_of, write_bounds
from baryscope.study.bounds import BoundTable, Cell, Grid, bound_table, path_in_words, usual_grid, variant_of
from baryscope.table import Table

Number = TypeVar("Number", bound=float)

IN_BOUND = frozenset({Force.J2})


@Parameter(name="*")
@dataclass(frozen=True)
class Lists:
    """Lists of values for the table.

    Parameters
    ----------
    durations
        Durations of the run, s. The values of a list are separated by commas.
    ranges
        Initial distances of the chaser, m; its position and velocity are scaled to them.
    rates
        Tumble rates, degrees per second; the angular rate is scaled to them.
    features
        Numbers of features: the first ones of the scenario are taken.
    baselines
        Baselines of the stereo rig, m; the scenario must have a rig.
    """

    durations: str | None = None
    ranges: str | None = None
    rates: str | None = None
    features: str | None = None
    baselines: str | None = None

    @property
    def empty(self) -> bool:
        """Whether no list is given."""
        return all(one is None for one in astuple(self))

    def grid(self) -> Grid:
        """The lists as numbers.

        Raises:
            InputError: something is no list of numbers above 0.
        """
        return Grid(
            durations=_numbers("durations", self.durations, float),
            ranges=_numbers("ranges", self.ranges, float),
            rates=_numbers("rates", self.rates, float),
            features=_numbers("features", self.features, int),
            baselines=_numbers("baselines", self.baselines, float),
        )


def bound(
    *,
    scenario: str = "envisat",
    lists: Lists | None = None,
    trajectory: str | None = None,
    process_noise: float = 0.0,
    acceleration_scale: float = 0.0,
    rig: Path | None = None,
    predict: float | None = None,
    table: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Compute the Cramér–Rao bound of a scenario: the least RMSE of any unbiased estimate. Nothing is simulated.

    With lists (durations, ranges, rates, features, baselines), a table over all their combinations; what has no list
    stays as the scenario has it. --table or -o without a list takes a default set of durations, rates and, where the
    noise depends on it, ranges.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    trajectory
        Model of the path that is known: fixed, polynomial:N or relative-orbit. Default: relative-orbit.
    process_noise
        Density of the white acceleration that the path's model leaves out, m²/s³, besides that of the scenario's
        thrusters (chaser.acceleration_noise).
    acceleration_scale
        Standard deviation of the scale with which the scenario's acceleration of the chaser is measured.
    rig
        What is uncertain about the camera: a TOML file with a table [rig], see `baryscope estimate`.
    predict
        How long after the last frame the position is asked for, s.
    table
        Print the table without any list, too.
    output
        Folder for bound.csv, bound.md and a picture.
    """
    show, lists = show or Show(), lists or Lists()
    base = load_scenario(scenario)
    if output is not None:
        check_outputs(bound_paths(output), [scenario_path(scenario)])
    consider = None if rig is None else load_rig(rig)
    if left_out := sorted(base.forces - IN_BOUND):
        show.remark(f"{scenario}: the bound takes no account of its {' and '.join(left_out)}")
    if lists.empty and not table and output is None:
        words = path_in_words(base, trajectory, process_noise)
        with show.progress() as progress, stage(progress, "Cramér–Rao bound"):
            own = cramer_rao_bound(
                base,
                trajectory=trajectory,
                process_noise=process_noise,
                acceleration_scale=acceleration_scale,
                consider=consider,
                predict=predict or 0.0,
            )
        _show_own(base, words, own, predict, show)
        return
    if predict is not None or acceleration_scale:
        name = "--acceleration-scale" if predict is None else "--predict"
        raise InputError(f"{name}: found with a table, expected the scenario alone")
    grid = usual_grid(base) if lists.empty else lists.grid()
    with show.progress() as progress:
        found = bound_table(base, grid, trajectory, progress, process_noise=process_noise, consider=consider)
    lines: list[str | Table] = [*found.tables(), *found.notes()]
    if output is not None:
        markdown, table_file, *_ = write_bounds(found, output)
        lines.append(f"More in {markdown} and {table_file}")
    show.result(found.to_json(), *lines)


def _numbers(name: str, text: str | None, kind: Callable[[str], Number]) -> list[Number] | None:
    """The numbers of a list; None without one."""
    if text is None:
        return None
    what = "whole numbers" if name == "features" else "numbers"
    try:
        values = [kind(item) for item in text.split(",") if item.strip()]
    except ValueError:
        values = []
    if not values or not all(math.isfinite(value) and value > 0 for value in values):
        raise InputError(f"--{name}: found {text!r}, expected {what} above 0, separated by commas")
    return values


def _show_own(scenario: Scenario, known: str, found: Bound, predict: float | None, show: Show) -> None:
    """The bound of the scenario itself, in a few lines."""
    data, lines = (
        BoundTable(scenario, known, (Cell(variant_of(scenario), found),)).to_json(),
        _lines(scenario, known, found),
    )
    if predict is not None:
        lines.append(f"  centre of mass {predict:g} s ahead  {1000 * found.predicted_deviation:.3g} mm")
        data |= {"predict": predict, "predicted_rmse": found.predicted_deviation}
    show.result(data, *lines)


def _lines(scenario: Scenario, trajectory: str, found: Bound) -> list[str]:
    return [
        f"{scenario.name}: {scenario.duration:.0f} s at {1 / scenario.run.sample_time:g} Hz, {found.observations} "
        f"observations of {len(scenario.features.points)} features, {noise_of(scenario)}, path {trajectory}",
        f"  Cramér–Rao bound on path RMSE  {1000 * found.position_deviation:.3g} mm",
        f"  centre of mass in body axes    {1000 * found.offset_deviation:.3g} mm",
        f"  attitude                       {np.rad2deg(found.attitude_deviation):.3g}°",
        f"  angular rate                   {np.rad2deg(found.rate_deviation):.3g} °/s",
        f"  inertia over its trace         {found.inertia_deviation:.3g}",
        f"  centre of mass {verdict(found.observability)}",
    ]
