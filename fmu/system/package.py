"""From a scenario to a packed system: the units and the .ssd in one .ssp archive."""

from pathlib import Path

from baryscope.fmu.generate.build import pack_unit
from baryscope.fmu.generate.compiler import Progress
from baryscope.fmu.layout.archive import pack
from baryscope.fmu.layout.platforms import Selection
from baryscope.fmu.system.chain import chain_of
from baryscope.fmu.system.guest import read_guest
from baryscope.fmu.system.structure import STRUCTURE, source_of, system_structure
from baryscope.models.files import AnyPath, replacing, temporary_folder
from baryscope.models.scenario import Scenario


def build_system(
    scenario: Scenario,
    path: AnyPath,
    *,
    controller: AnyPath | None = None,
    platforms: Selection = "host",
    progress: Progress | None = None,
) -> Path:
    """Build the chain of target, rig, estimator and controller of a scenario as SSP 1.0, with units of FMI 2.0.

    Args:
        scenario: gives the start values, which are bound as parameters, too.
        path: where to write; an existing file is replaced when the build has succeeded.
        controller: another tool's FMU in the place of ApproachController, with its outputs that are connected and as
            many of its inputs and parameters as it needs, by the same names.
        platforms: as of `build_fmu`.
        progress: told which platforms are still being compiled for.

    Returns:
        The path written.

    Raises:
        InputError: the path cannot be written, a unit cannot be made of the scenario, or the controller does not fit.
        ComputationError: there is no C compiler, or no ziglang for other platforms, or it fails.
    """
    path, guests = Path(path), {} if controller is None else {"controller": read_guest(controller)}
    chain = chain_of(scenario, guests)
    members = {STRUCTURE: system_structure(chain, scenario.name, scenario.duration)}
    with replacing(path) as temporary, temporary_folder() as folder:
        for element, unit in chain.units.items():
            if element in guests:
                members[source_of(element)] = guests[element].path.read_bytes()
                continue
            fmu = pack_unit(unit, folder / f"{element}.fmu", platforms=platforms, progress=progress)
            members[source_of(element)] = fmu.read_bytes()
        pack(temporary, members)
    return path
