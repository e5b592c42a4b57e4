"""`baryscope simulate`: fly a scenario with its unit; write what the chaser measures, the truth and the orbit."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from baryscope import __version__
from baryscope.estimator.formats import writable
from baryscope.models.files import check_outputs
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.models.words import counted
from baryscope.progress import stage
from baryscope.scripts.cli.console import Show
from baryscope.study import fly, write_flight
from baryscope.study.flight import flight_paths


def simulate_scenario(
    *,
    scenario: str = "envisat",
    fmu: Path | None = None,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Simulate a scenario and write the tracks of the features; truth and orbit are written beside them.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    fmu
        A unit that `baryscope build` made for as many features. Default: a new one is built.
    output
        The tracks, a .csv, .parquet or .nc file or a .zarr folder. Default: the scenario's name with .csv. Beside
        TRACKS.csv the truth is in TRACKS.truth.csv and the orbit, as `baryscope estimate --orbit` reads it, in
        TRACKS.orbit.toml.
    """
    show = show or Show()
    flown = load_scenario(scenario)
    path = writable(output or Path(f"{flown.name}.csv"))
    check_outputs(flight_paths(path), [scenario_path(scenario), *([] if fmu is None else [fmu])])
    with show.progress() as progress:
        flight = fly(flown, fmu, progress)
        with stage(progress, "writing"):
            tracks, truth, orbit = write_flight(flight, path)
    observations, frames = int(flight.tracks.seen.sum()), flight.tracks.time.size
    files = {"tracks": str(tracks), "truth": str(truth), "orbit": str(orbit)}
    show.result(
        {"version": __version__, "frames": frames, "observations": observations, **files},
        f"{tracks}: {counted(observations, 'observation')} at {counted(frames, 'time')}; "
        f"truth in {truth}, orbit in {orbit}",
    )
