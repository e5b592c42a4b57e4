"""From a scenario to a packed FMU: generate, describe, compile, zip."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from baryscope.fmu.generate.codegen import generated_sources, scenario_source
from baryscope.fmu.generate.compiler import Job, Progress, compile_all, find_compiler, find_cross_compiler
from baryscope.fmu.generate.description import model_description
from baryscope.fmu.generate.documentation import documents
from baryscope.fmu.generate.sources import (
    MAIN,
    SCENARIO,
    build_description,
    interface_headers,
    licences,
    unit_sources,
)
from baryscope.fmu.layout.archive import pack
from baryscope.fmu.layout.platforms import FmiVersion, Selection, binary_members, selected
from baryscope.fmu.units import Blueprint, blueprint_of
from baryscope.models.files import AnyPath, replacing
from baryscope.models.scenario import Scenario


def build_fmu(
    scenario: Scenario,
    path: AnyPath,
    *,
    unit: str = "target",
    fmi: FmiVersion = 2,
    scalar: bool = False,
    platforms: Selection = "host",
    progress: Progress | None = None,
) -> Path:
    """Build a unit of a scenario for Co-Simulation, the target also for Model Exchange, with its sources.

    The number of features and the forces are built in; every other number of the scenario becomes a start value, which
    importers can change before initialization. Equal scenarios give equal files, whatever the folder; with "linux"
    and "all", whatever the machine, too, as long as the package ziglang is of the same version.

    Args:
        scenario: gives the start values.
        unit: which one, a key of `baryscope.fmu.units.UNITS`.
        path: where to write; an existing file is replaced when the build has succeeded.
        fmi: the version, 2.0 or 3.0.
        scalar: in FMI 3, describe every scalar by itself, for importers that trip over arrays.
        platforms: "host" compiles for this machine, "linux" for glibc 2.17 on x86-64 and aarch64, "all" for these,
            macOS (11) on both and Windows on x86-64. Compiled libraries are kept (see
            `baryscope.fmu.generate.cache`).
        progress: told which platforms are still being compiled for; zig's first build for Windows takes minutes.

    Returns:
        The path written.

    Raises:
        InputError: the path cannot be written, or there is no such unit.
        ComputationError: there is no C compiler, or no ziglang for other platforms, or it fails.
    """
    return pack_unit(blueprint_of(unit, scenario), path, fmi=fmi, scalar=scalar, platforms=platforms, progress=progress)


def pack_unit(
    unit: Blueprint,
    path: AnyPath,
    *,
    fmi: FmiVersion = 2,
    scalar: bool = False,
    platforms: Selection = "host",
    progress: Progress | None = None,
) -> Path:
    """Build the unit of a blueprint; arguments, result and errors are those of `build_fmu`."""
    path = Path(path)
    description, sources = describe_unit(unit, fmi, scalar=scalar)
    with replacing(path) as temporary:
        headers = interface_headers(fmi)
        compiler = tuple(find_compiler() if platforms == "host" else find_cross_compiler())
        jobs = [
            Job(sources | headers, MAIN, f"{unit.name}{platform.suffix}", platform, compiler, SCENARIO)
            for platform in selected(platforms)
        ]
        libraries = compile_all(jobs, progress)
        members = licences(headers) | {"modelDescription.xml": description}
        members |= documents(unit, fmi, scalar=scalar)
        if fmi == 3:
            members["sources/buildDescription.xml"] = build_description(unit.name)
        members |= {f"sources/{name}": content for name, content in sources.items()}
        pack(temporary, members, programs=binary_members(libraries, unit.name, fmi))
    return path


def describe_unit(
    unit: Blueprint, fmi: FmiVersion, *, scalar: bool = False, main: str = MAIN
) -> tuple[bytes, dict[str, bytes]]:
    """A unit's modelDescription.xml, and its C sources by name: `main` and the files that it includes, but FMI's."""

    generated = generated_sources(unit, fmi, scalar)

    def sources(token: str) -> dict[str, bytes]:
        return unit_sources(generated | {SCENARIO: scenario_source(unit, token)}, fmi, main)

    token = _token(sources(""), model_description(unit, "", fmi, scalar))
    return model_description(unit, token, fmi, scalar), sources(token)


def _token(sources: Mapping[str, bytes], description: bytes) -> str:
    """A GUID that depends on everything the unit is made from."""
    digest = hashlib.sha256(description)
    for name, content in sources.items():
        digest.update(f"\0{name}\0".encode() + content)
    text = digest.hexdigest()
    return f"{{{text[:8]}-{text[8:12]}-{text[12:16]}-{text[16:20]}-{text[20:32]}}}"
