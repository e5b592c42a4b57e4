"""`baryscope build`: the co-simulation unit of a scenario."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from baryscope.fmu import build_fmu
from baryscope.models.errors import InputError
from baryscope.models.scenario import load_scenario
from baryscope.scripts.console import out, step


def build(
    *,
    scenario: str = "envisat",
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Build the unit (FMI 2.0 Co-Simulation) of a scenario for this machine.

    Parameters
    ----------
    scenario
        A preset's name (see `baryscope scenarios`) or a scenario file, FILE.toml.
    output
        The FMU to write; the scenario's name with .fmu unless given.
    """
    flown = load_scenario(scenario)
    path = output or Path(f"{flown.name}.fmu")
    if path.suffix != ".fmu":
        raise InputError(f"{path}: ends in {path.suffix!r}, expected .fmu")
    with step("building the unit"):
        build_fmu(flown, path)
    out.print(f"{path}: {len(flown.features.points)} features, {path.stat().st_size / 1000:.0f} kB", soft_wrap=True)
