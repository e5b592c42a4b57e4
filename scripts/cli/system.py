"""`baryscope system`: the whole loop of a scenario as one archive."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from baryscope import __version__
from baryscope.fmu.system import build_system
from baryscope.models.errors import InputError
from baryscope.models.files import check_outputs
from baryscope.models.scenario import load_scenario, scenario_path
from baryscope.progress import stage
from baryscope.scripts.cli.console import Show


def system(
    *,
    scenario: str = "envisat",
    controller: Path | None = None,
    platforms: Literal["host", "linux", "all"] = "host",
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Write the loop of target, rig, estimator and controller as SSP 1.0: units, connections, parameters.

    fmpy, libcosim, Ecos and `baryscope fly` run it as it is. Parameters are bound at the components, in the archive's
    SystemStructure.ssd.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    controller
        Another tool's FMU 2.0 in the place of ApproachController. It is connected by the names of its variables: it
        needs the outputs command.acceleration and camera.attitude, and has those of the inputs that it wants; its
        parameters of the same names get the scenario's values.
    platforms
        As of `baryscope build`: `host`, this machine and those with the same C library or a later one; `linux`; `all`.
    output
        The archive, an .ssp file. Default: the scenario's name with .ssp.
    """
    show = show or Show()
    flown = load_scenario(scenario)
    path = output or Path(f"{flown.name}.ssp")
    if path.suffix != ".ssp":
        raise InputError(f"{path}: ends in {path.suffix!r}, expected .ssp")
    check_outputs([path], [at for at in (scenario_path(scenario), controller) if at is not None])
    with show.progress() as progress, stage(progress, "building the units") as share:
        build_system(flown, path, controller=controller, platforms=platforms, progress=lambda _, done: share(done))
    last = "controller" if controller is None else f"{controller} as controller"
    size = path.stat().st_size
    data = {"version": __version__, "file": str(path), "scenario": flown.name, "bytes": size}
    show.result(data, f"{path}: target, rig, estimator and {last}, {size / 1000:.0f} kB")
