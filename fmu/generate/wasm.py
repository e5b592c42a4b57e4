"""The unit as a WebAssembly module, for browsers and Node. FMI has no folder for it, so it is a file of its own."""

import json
from pathlib import Path

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.compiler import Job, Progress, compile_all, find_cross_compiler
from baryscope.fmu.generate.sources import interface_headers
from baryscope.fmu.layout.platforms import Platform
from baryscope.fmu.units import Blueprint, blueprint_of
from baryscope.models.files import AnyPath, replacing
from baryscope.models.scenario import Scenario

WASM = Platform(
    "wasm32-wasi",
    "wasm32-wasi",
    "wasm32-wasi",
    ".wasm",
    "wasm32-wasi",
    # A reactor is a library: _initialize is called once, then its functions.
    ("-mexec-model=reactor", "-Wl,--export-dynamic", "-Wl,--export=malloc", "-Wl,--export=free"),
)


def build_wasm(scenario: Scenario, path: AnyPath, *, unit: str = "target", progress: Progress | None = None) -> Path:
    """Build a scenario's unit as a WebAssembly module, with a table of its variables beside it.

    The module imports nothing, and exports its memory, `malloc`, `free`, `_initialize` (to be called first), the
    fmi2* functions, `unit_instantiate()`, which calls fmi2Instantiate, and `unit_message()`, the last message of the
    unit. scripts/examples/step_unit.mjs is an example. The table, in JSON, has the path's name with .json: for every
    variable name, kind, unit, description, shape and first value reference (the others follow, in row-major order).

    Args:
        scenario: gives the number of features and the start values.
        path: the module to write.
        unit: which one, a key of `baryscope.fmu.units.UNITS`.
        progress: told what is being compiled.

    Returns:
        The module's path.

    Raises:
        InputError: a path cannot be written, or there is no such unit.
        ComputationError: ziglang is not installed, or fails.
    """
    path = Path(path)
    blueprint = blueprint_of(unit, scenario)
    _, sources = describe_unit(blueprint, 2, main="wasm.c")
    with replacing(path) as module, replacing(path.with_suffix(".json")) as table:
        job = Job(
            sources | interface_headers(2), "wasm.c", f"{blueprint.name}.wasm", WASM, tuple(find_cross_compiler())
        )
        module.write_bytes(compile_all([job], progress)[WASM])
        table.write_text(_variables(blueprint), encoding="utf-8")
    return path


def _variables(unit: Blueprint) -> str:
    variables, reference = [], 0
    for variable in unit.variables:
        variables.append(
            {
                "name": variable.name,
                "kind": variable.kind.value,
                "unit": variable.unit,
                "description": variable.whole_description(unit.setting.labels),
                "shape": list(variable.shape),
                "reference": reference,
            }
        )
        reference += variable.size
    experiment = {"stopTime": unit.setting.stop_time, "stepSize": unit.setting.step_size}
    return json.dumps({"model": unit.name, "experiment": experiment, "variables": variables}, indent=1)
