"""GPA against least squares against raw points, on the same noisy tracks: the tables of docs/gpa_study.md.

    python scripts/benchmarks/gpa_study.py > docs/gpa_study_tables.md

Envisat on V-bar at 20 m, all features in view for 600 s at 1 Hz. Every number is the median over several draws of
the noise of the rms error of the path, at every frame. "-" means that the method said it could not be done.
"""

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from baryscope.estimator.methods import METHODS, estimate
from baryscope.estimator.options import ScrewOptions
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Recording, build_fmu, simulate
from baryscope.models.errors import ComputationError
from baryscope.models.scenario import load_scenario
from baryscope.scripts.cli.console import VERSION, step

DURATION = 600  # s
DRAWS = 9
LAGS = (1.0, 3.0, 10.0, 25.0)  # s: 3.5, 10, 35 and 87 degrees of turn
NOISES = (0.01, 0.02, 0.05)  # m
COUNTS = (3, 5, 10)
AXES = ("inertial", "lvlh")
# So ordered that the first three already span the body.
ORDER = (
    "bus-end-a", "asar-end-b", "array-hinge", "bus-root-a", "zenith-antenna",
    "asar-end-a", "bus-end-b", "laser-reflector", "radiator-edge", "bus-root-b",
)  # fmt: skip


def noisy_tracks(truth: Recording, labels: tuple[str, ...], count: int, noise: float, seed: int) -> FeatureTracks:
    """The first `count` features of ORDER with isotropic noise; equal seeds give equal draws, scaled."""
    columns = [labels.index(label) for label in ORDER[:count]]
    draw = np.random.default_rng(np.random.SeedSequence([seed, count])).standard_normal((truth.time.size, count, 3))
    return FeatureTracks(truth.time, truth["features"][:, columns] + noise * draw, ORDER[:count])


def rms_error(tracks: FeatureTracks, truth: Recording, method: str, axes: str, lag: float) -> float:
    """Rms error of the path, m; NaN where the method says that it cannot be done."""
    options = ScrewOptions(lag=lag, axes="lvlh" if axes == "lvlh" else "inertial")
    try:
        result = estimate(tracks, method=method, orbit=load_scenario("envisat").orbit, options=options)
    except ComputationError:
        return np.nan
    return float(np.sqrt(np.mean(np.sum((result.position - truth["target.position"]) ** 2, axis=1))))


def cell(values: Iterable[float]) -> str:
    """The median, in mm below a metre; how many draws failed, if any did."""
    array = np.array(list(values))
    failed = int(np.isnan(array).sum())
    if failed == array.size:
        return "-"
    median = float(np.nanmedian(array))
    text = f"{1000 * median:.1f} mm" if median < 1 else f"{median:.2f} m"
    return f"{text} ({failed} of {array.size} failed)" if failed else text


def main() -> int:
    """Run the grid and print Markdown."""
    scenario = load_scenario("envisat")
    with tempfile.TemporaryDirectory(prefix="baryscope-") as folder:
        unit = build_fmu(scenario, Path(folder) / "unit.fmu")
        truth = simulate(unit, np.arange(DURATION + 1.0), scenario.parameters())
    print(f"baryscope {VERSION}, {DRAWS} draws a cell, {DURATION} s at 1 Hz, scenario envisat.")
    for axes in AXES:
        print(f"\n## {axes} axes\n")
        print("| features | noise | lag | " + " | ".join(METHODS) + " |")
        print("| ---: | ---: | ---: |" + " ---: |" * len(METHODS))
        for count in COUNTS:
            for noise in NOISES:
                with step(f"{axes} axes, {count} features, {noise:g} m"):
                    draws = [noisy_tracks(truth, scenario.features.labels, count, noise, seed) for seed in range(DRAWS)]
                    for lag in LAGS:
                        cells = [cell(rms_error(d, truth, method, axes, lag) for d in draws) for method in METHODS]
                        print(f"| {count} | {100 * noise:.0f} cm | {lag:g} s | " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
