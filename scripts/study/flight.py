"""Flights: a scenario flown by its unit, and what the chaser measures of the target."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.formats.write import writable, writer_of_tracks
from baryscope.estimator.tracks import FeatureTracks
from baryscope.fmu import Recording, Session, build_fmu, simulate
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, temporary_folder, write_together
from baryscope.models.scenario import Scenario, load_scenario, orbit_text
from baryscope.models.sensor.tracking import observe
from baryscope.progress import Progress, stage

FloatArray = NDArray[np.float64]

TRUTH_COLUMNS = {
    "target.position": ("x", "y", "z"),
    "target.velocity": ("vx", "vy", "vz"),
    "target.attitude": ("qw", "qx", "qy", "qz"),
    "target.angularRate": ("wx", "wy", "wz"),
}


@dataclass(frozen=True, eq=False)
class Flight:
    """What is flown, the truth, and the tracks that are measured of it.

    Attributes:
        scenario: what is flown.
        truth: every output of the unit at the sample times; `truth["target.position"]` is (n, 3).
        tracks: of the features, with the noise, gaps and outliers of the scenario's sensor.
    """

    scenario: Scenario
    truth: Recording
    tracks: FeatureTracks

    def __repr__(self) -> str:
        """What was flown, in a line."""
        return f"<Flight of {self.scenario.name}: {self.tracks!r}>"

    @property
    def true_path(self) -> FloatArray:
        """The centre of mass in frame C at every time, (n, 3), m."""
        return self.truth["target.position"]


def fly(scenario: Scenario | AnyPath, unit: AnyPath | None = None, progress: Progress | None = None) -> Flight:
    """Step a unit through a scenario and track its features as the scenario's sensor does.

    Args:
        scenario: a scenario, a preset's name or a scenario file, FILE.toml.
        unit: an FMU built for as many features; built on the spot unless given.
        progress: told how far the work is.

    Raises:
        InputError: no such scenario, or a unit that does not fit it.
        ComputationError: the unit cannot be built or stepped.
    """
    flown = scenario_of(scenario)
    with temporary_folder() as folder:
        fmu = build_unit(flown, folder / "unit.fmu", progress) if unit is None else unit
        with stage(progress, f"simulating {flown.duration:.0f} s at {1 / flown.run.sample_time:g} Hz") as share:
            try:
                truth = simulate(
                    fmu,
                    flown.sample_times,
                    flown.parameters(),
                    acceleration=flown.chaser.acceleration,
                    control=_thruster(flown),
                    progress=share,
                )
            except InputError as error:
                if str(error).startswith(str(fmu)):
                    raise
                raise InputError(f"{flown.name} in {fmu}: {error}") from error
    observation = observe(
        flown,
        truth.time,
        truth["features"],
        truth["normals"],
        target_C=truth["target.position"],
        attitude=truth["target.attitude"],
    )
    tracks = FeatureTracks(truth.time, observation.position, flown.features.labels, observation.covariance)
    return Flight(flown, truth, tracks)


def thrust(scenario: Scenario) -> FloatArray:
    """The chaser's acceleration over each sample interval, held in LVLH: the constant one and white noise.

    The noise has a random stream of its own, so that it leaves the sensor's as it is.

    Returns:
        (samples - 1, 3), m/s².
    """
    shape = (len(scenario.sample_times) - 1, 3)
    deviation = np.sqrt(scenario.chaser.acceleration_noise / scenario.run.sample_time)
    draws = np.random.default_rng(np.random.SeedSequence(scenario.run.seed).spawn(6)[5]).standard_normal(shape)
    accelerations: FloatArray = np.array(scenario.chaser.acceleration) + deviation * draws
    return accelerations


def _thruster(scenario: Scenario) -> Callable[[Session], None] | None:
    """Sets the thrust before each step; None where it is constant."""
    if scenario.chaser.acceleration_noise == 0:
        return None
    accelerations = iter(thrust(scenario))
    return lambda session: session.set_inputs(acceleration=next(accelerations))


def scenario_of(scenario: Scenario | AnyPath) -> Scenario:
    """A scenario, or the one of a preset's name or of a scenario file.

    Raises:
        InputError: there is no such scenario.
    """
    return scenario if isinstance(scenario, Scenario) else load_scenario(scenario)


def build_unit(scenario: Scenario | AnyPath, path: AnyPath, progress: Progress | None = None) -> Path:
    """Build the unit of a scenario, FMI 2.0, for this machine.

    Raises:
        ComputationError: there is no compiler, or it fails.
    """
    with stage(progress, "building the unit") as share:
        return build_fmu(scenario_of(scenario), path, progress=lambda _, done: share(done))


def flight_paths(path: AnyPath) -> tuple[Path, Path, Path]:
    """The files of a flight: tracks, truth and orbit.

    Raises:
        InputError: the name of the tracks ends in none of .csv, .parquet and .nc.
    """
    tracks = writable(path)
    return tracks, tracks.with_suffix(".truth.csv"), tracks.with_suffix(".orbit.toml")


def write_flight(flight: Flight, path: AnyPath) -> tuple[Path, ...]:
    """Write the tracks as TRACKS.csv (or .parquet, .nc), the truth as TRACKS.truth.csv, the orbit as TRACKS.orbit.toml.

    Returns:
        The files, in this order.

    Raises:
        InputError: another ending, or a file cannot be written.
    """
    tracks, truth, orbit = flight_paths(path)
    write_together(
        {
            tracks: writer_of_tracks(flight.tracks, tracks),
            truth: partial(write_truth, flight.truth),
            orbit: lambda stream: stream.write(orbit_text(flight.scenario.orbit.of_simulation())),
        }
    )
    return tracks, truth, orbit


def write_truth(truth: Recording, stream: TextIO) -> None:
    """Write CoM position and velocity in C, attitude (w, x, y, z; body to inertial) and angular rate (body axes)."""
    columns = np.hstack([truth.time[:, None], *(truth[name] for name in TRUTH_COLUMNS)])
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *(label for labels in TRUTH_COLUMNS.values() for label in labels)])
    writer.writerows(columns.tolist())
