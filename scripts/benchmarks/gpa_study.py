"""GPA against least squares against raw points, on the same noisy tracks: the tables of docs/gpa_study.md.

    python scripts/benchmarks/gpa_study.py [--quick]

Envisat on V-bar at 20 m, all features in view for 600 s at 1 Hz. Every number is the median over several draws of
the noise of the RMSE of the path, at every frame. "-" means that the method said it could not be done. --quick takes
one draw of a small grid: to see that it works.
"""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import sys  # noqa: E402
from collections.abc import Iterable, Sequence  # noqa: E402
from dataclasses import dataclass  # noqa: E402

import numpy as np  # noqa: E402

from baryscope import __version__  # noqa: E402
from baryscope.estimator import METHODS, FeatureTracks, ScrewOptions, estimate  # noqa: E402
from baryscope.models.errors import ComputationError  # noqa: E402
from baryscope.models.scenario import Scenario, load_scenario  # noqa: E402
from baryscope.progress import Progress, stage  # noqa: E402
from baryscope.scripts.cli.console import Show  # noqa: E402
from baryscope.study import Flight, fly  # noqa: E402
from baryscope.table import Table  # noqa: E402

DURATION = 600.0  # s
METHODS_OF_SCREWS = tuple(name for name, method in METHODS.items() if method.options is ScrewOptions)
AXES = ("inertial", "lvlh")
# So ordered that the first three already span the body.
ORDER = (
    "bus-end-a", "asar-end-b", "array-hinge", "bus-root-a", "zenith-antenna",
    "asar-end-a", "bus-end-b", "laser-reflector", "radiator-edge", "bus-root-b",
)  # fmt: skip


@dataclass(frozen=True)
class Grid:
    """How many draws of the noise, numbers of features, standard deviations in m, and lags in s."""

    draws: int
    counts: tuple[int, ...]
    noises: tuple[float, ...]
    lags: tuple[float, ...]  # 3.5, 10, 35 and 87 degrees of turn


FULL = Grid(9, (3, 5, 10), (0.01, 0.02, 0.05), (1.0, 3.0, 10.0, 25.0))
QUICK = Grid(1, (10,), (0.01,), (10.0,))


def study_scenario() -> Scenario:
    """Envisat for DURATION."""
    data = load_scenario("envisat").model_dump(mode="json", exclude_unset=True)
    data["tracking"] = {}
    data["run"] = {"duration": DURATION, "sample_time": 1.0}
    return Scenario.parse(data, "envisat")


def noisy_tracks(flight: Flight, count: int, noise: float, seed: int) -> FeatureTracks:
    """The first `count` features of ORDER with isotropic noise; equal seeds give equal draws, scaled."""
    truth = flight.truth
    columns = [flight.scenario.features.labels.index(label) for label in ORDER[:count]]
    draw = np.random.default_rng(np.random.SeedSequence([seed, count])).standard_normal((truth.time.size, count, 3))
    return FeatureTracks(truth.time, truth["features"][:, columns] + noise * draw, ORDER[:count])


def rmse(tracks: FeatureTracks, flight: Flight, method: str, axes: str, lag: float) -> float:
    """RMSE of the path, m; NaN where the method says that it cannot be done."""
    options = ScrewOptions(lag=lag, axes="lvlh" if axes == "lvlh" else "inertial")
    try:
        result = estimate(tracks, method=method, orbit=flight.scenario.orbit.of_simulation(), options=options)
    except ComputationError:
        return np.nan
    return float(np.sqrt(np.mean(np.sum((result.position - flight.true_path) ** 2, axis=1))))


def cell(values: Iterable[float]) -> str:
    """The median, in mm below a metre; how many draws failed, if any did."""
    array = np.array(list(values))
    failed = int(np.isnan(array).sum())
    if failed == array.size:
        return "-"
    median = float(np.nanmedian(array))
    text = f"{1000 * median:.1f} mm" if median < 1 else f"{median:.2f} m"
    return f"{text} ({failed} of {array.size} failed)" if failed else text


def table(flight: Flight, grid: Grid, axes: str, progress: Progress | None = None) -> Table:
    """A row for each number of features, noise and lag, in some axes."""
    rows = []
    combinations = [(count, noise) for count in grid.counts for noise in grid.noises]
    with stage(progress, f"{axes} axes") as share:
        for done, (count, noise) in enumerate(combinations):
            draws = [noisy_tracks(flight, count, noise, seed) for seed in range(grid.draws)]
            for lag in grid.lags:
                cells = [cell(rmse(d, flight, method, axes, lag) for d in draws) for method in METHODS_OF_SCREWS]
                rows.append((str(count), f"{100 * noise:.0f} cm", f"{lag:g} s", *cells))
            share((done + 1) / len(combinations))
    return Table(("features", "noise", "lag", *METHODS_OF_SCREWS), tuple(rows), left=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the grid and print Markdown."""
    given = sys.argv[1:] if arguments is None else arguments
    grid = QUICK if "--quick" in given else FULL
    with Show().progress() as progress:
        flight = fly(study_scenario(), progress=progress)
        print(f"baryscope {__version__}, {grid.draws} draws a cell, {DURATION:.0f} s at 1 Hz, scenario envisat.")
        for axes in AXES:
            words = "inertial" if axes == "inertial" else "LVLH"
            print(f"\n### {words} axes\n\n{table(flight, grid, axes, progress).markdown()}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
