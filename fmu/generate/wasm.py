"""The unit as a WebAssembly module, for browsers and Node. FMI has no folder for it, so it is a file of its own."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.compiler import Job, Progress, compile_all, find_cross_compiler
from baryscope.fmu.generate.sources import SCENARIO, interface_headers
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


@dataclass(frozen=True)
class Module:
    """A unit in WebAssembly: its code, and the table of its variables as JSON has it."""

    code: bytes
    table: dict[str, Any]


def wasm_module(unit: Blueprint, progress: Progress | None = None) -> Module:
    """Compile the unit of a blueprint; `build_wasm` says what is in it.

    Raises:
        ComputationError: ziglang is not installed, or fails.
    """
    _, sources = describe_unit(unit, 2, main="wasm.c")
    compiler = tuple(find_cross_compiler())
    job = Job(sources | interface_headers(2), "wasm.c", f"{unit.name}.wasm", WASM, compiler, SCENARIO)
    return Module(compile_all([job], progress)[WASM], _table(unit))


def build_wasm(scenario: Scenario, path: AnyPath, *, unit: str = "target", progress: Progress | None = None) -> Path:
    """Build a scenario's unit as a WebAssembly module, with a table of its variables beside it.

    The module imports nothing, and exports its memory, `malloc`, `free`, `_initialize` (to be called first), the
    fmi2* functions, `unit_instantiate()`, which calls fmi2Instantiate, and `unit_message()`, the last message of the
    unit. fmu/runtime/unit.mjs steps it, as scripts/examples/step_unit.mjs shows. The table, in JSON, has the path's
    name with .json: for every variable name, kind, unit, description, shape, whether it is Boolean, and its first value
    reference (the others follow, in row-major order).

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
    with replacing(path) as module, replacing(path.with_suffix(".json")) as table:
        built = wasm_module(blueprint, progress)
        module.write_bytes(built.code)
        table.write_text(json.dumps(built.table, indent=1), encoding="utf-8")
    return path


def _table(unit: Blueprint) -> dict[str, Any]:
    variables, reference = [], 0
    for variable in unit.variables:
        variables.append(
            {
                "name": variable.name,
                "kind": variable.kind.value,
                "unit": variable.unit,
                "description": variable.whole_description(unit.setting.labels),
                "shape": list(variable.shape),
                "boolean": variable.boolean,
                "reference": reference,
            }
        )
        reference += variable.size
    experiment = {"stopTime": unit.setting.stop_time, "stepSize": unit.setting.step_size}
    return {"model": unit.name, "experiment": experiment, "variables": variables}
