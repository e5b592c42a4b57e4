"""`baryscope simulate`: fly a scenario with its unit; write what the chaser measures, and the truth."""

import csv
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Recording, build_fmu, simulate
from baryscope.models.errors import InputError
from baryscope.models.files import replacing
from baryscope.models.scenario import Scenario, load_scenario
from baryscope.models.sensor.tracking import observe
from baryscope.models.words import counted
from baryscope.scripts.cli.console import Report, out, step


@dataclass(frozen=True)
class Flight:
    """What was flown: the truth, and what was measured of it."""

    truth: Recording
    tracks: FeatureTracks


def fly(scenario: Scenario, fmu: Path, progress: Report | None = None) -> Flight:
    """Step a unit through a scenario and track its features as the scenario's sensor does."""
    truth = simulate(
        fmu,
        scenario.sample_times,
        scenario.parameters(),
        acceleration=scenario.chaser.acceleration,
        progress=progress,
    )
    observation = observe(
        scenario,
        truth.time,
        truth["features"],
        truth["normals"],
        target_C=truth["target.position"],
        attitude=truth["target.attitude"],
    )
    tracks = FeatureTracks(truth.time, observation.position, scenario.features.labels, observation.covariance)
    return Flight(truth, tracks)


def simulate_scenario(
    *,
    scenario: str = "envisat",
    fmu: Path | None = None,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Fly a scenario and write the tracks of the features, and the truth beside them.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    fmu
        A unit made by `baryscope build` for as many features; built on the spot unless given.
    output
        The tracks, a .csv file; the scenario's name with .csv unless given. The truth goes to OUTPUT.truth.csv.
    """
    flown = load_scenario(scenario)
    path = csv_path(output or Path(f"{flown.name}.csv"))
    with tempfile.TemporaryDirectory(prefix="baryscope-") as folder:
        if fmu is None:
            fmu = Path(folder) / "unit.fmu"
            with step("building the unit"):
                build_fmu(flown, fmu)
        with step(f"simulating {flown.duration:.0f} s") as report:
            flight = fly(flown, fmu, report)
    truth_path = path.with_suffix(".truth.csv")
    with step("writing"):
        flight.tracks.write_csv(path)
        write_truth(flight.truth, truth_path)
    sightings = int(flight.tracks.seen.sum())
    out.print(
        f"{path}: {counted(sightings, 'sighting')} at {counted(flight.truth.time.size, 'time')}; truth in {truth_path}",
        soft_wrap=True,
    )


def csv_path(path: Path) -> Path:
    """The path of a table to write or read, if it is one we can.

    Raises:
        InputError: its name doesn't end in .csv.
    """
    if path.suffix != ".csv":
        raise InputError(f"{path}: ends in {path.suffix!r}, expected .csv")
    return path


_TRUTH_COLUMNS = {
    "target.position": ("x", "y", "z"),
    "target.velocity": ("vx", "vy", "vz"),
    "target.attitude": ("qw", "qx", "qy", "qz"),
    "target.angularRate": ("wx", "wy", "wz"),
}


def write_truth(truth: Recording, path: Path) -> None:
    """Write CoM position and velocity in C, attitude (w, x, y, z; body to inertial) and angular rate (body axes)."""
    columns = np.hstack([truth.time[:, None], *(truth[name] for name in _TRUTH_COLUMNS)])
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time", *(label for labels in _TRUTH_COLUMNS.values() for label in labels)])
        writer.writerows(columns.tolist())
