"""Checks of our own units against their tables of variables, and of TumblingTarget against the equations."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from baryscope.fmu.check.description import interfaces, is_float, limits_of, size_of
from baryscope.fmu.check.finding import Finding, error
from baryscope.fmu.check.instance import FloatArray, Instance
from baryscope.fmu.check.moving import move, scatter
from baryscope.fmu.check.units import display_unit_of, exponents_of_definition, unit_of
from baryscope.fmu.layout.references import variability_of
from baryscope.fmu.units import UNITS as KINDS
from baryscope.fmu.units.target import TARGET
from baryscope.models.target import tumbling_target
from baryscope.models.variables import DISPLAY_UNITS, UNITS, Kind, Variable, forces_of
from baryscope.models.words import counted

_TABLES = {kind.name: kind.table for kind in KINDS.values()}
_CAUSALITY = {Kind.INPUT: "input", Kind.PARAMETER: "parameter", Kind.OUTPUT: "output"}
STEPS = 20  # between a saved state and its restoring
AGREEMENT = 1e-9  # of an array's largest element: libraries round differently


def is_ours(description: Any) -> bool:
    """Whether baryscope made the unit."""
    tool = str(description.generationTool or "")
    return description.modelName in _TABLES and tool.startswith("baryscope")


def table_findings(description: Any) -> Iterator[Finding]:
    """Names, kinds, units and sizes are those of the table of variables, in its order."""
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    for unit in description.unitDefinitions:
        for display in unit.displayUnits:
            factor = DISPLAY_UNITS.get(unit.name, {}).get(display.name)
            if (float(display.factor or 1), float(display.offset or 0)) != (factor, 0.0):
                yield error(f'display unit "{display.name}"', f"found factor {display.factor}, expected {factor}")
    for name, exponents in UNITS.items():
        if name in units and (units[name] is None or exponents_of_definition(units[name]) != exponents):
            yield error(f'unit "{name}"', f"expected the base units {exponents or 'none'}")
    variables = [v for v in description.modelVariables if v.causality != "independent"]
    expected = [entry for variable in _table(description) for entry in _entries(variable, description)]
    names = [name for name, _, _ in expected]
    for stray in [v.name for v in variables if v.name not in set(names)]:
        yield error(stray, f"is not a variable of baryscope's {description.modelName}")
    there = {variable.name: variable for variable in variables}
    for name, variable, size in expected:
        if name not in there:
            yield error(name, "is missing, expected as in baryscope's table of variables")
            continue
        found = there[name]
        kind = _CAUSALITY.get(variable.kind, "local"), variability_of(variable)
        if (found.causality, found.variability) != kind:
            yield error(name, f"is a {found.variability} {found.causality}, expected a {kind[1]} {kind[0]}")
        if not variable.boolean and unit_of(found) != variable.unit:
            yield error(name, f'found unit "{unit_of(found)}", expected "{variable.unit}"')
        if not variable.boolean and (display_unit_of(found) or variable.unit) != variable.display_unit:
            yield error(name, f'found displayUnit "{display_unit_of(found)}", expected "{variable.display_unit}"')
        if not variable.boolean and limits_of(found) != variable.limits:
            yield error(
                name, "found limits {:g} to {:g}, expected {:g} to {:g}".format(*limits_of(found), *variable.limits)
            )
        if size_of(found) != size:
            yield error(name, f"found {size_of(found)} elements, expected {size}")


def model_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """The binary computes from the start values in the XML what the equations give, variable by variable."""
    if description.modelName != TARGET.name:
        return
    table = _table(description)
    count = next(variable.shape[0] for variable in table if variable.name == "features")
    system = tumbling_target(count, forces_of(variable.name for variable in table))
    with Instance(folder, description, name) as instance:
        instance.initialise()
        there = {variable.name: variable for variable in description.modelVariables}

        def read(variable: Variable) -> FloatArray | None:
            names = [entry for entry, _, _ in _entries(variable, description)]
            if any(entry not in there or is_float(there[entry]) == variable.boolean for entry in names):
                return None  # table_findings reports it
            return instance.get([there[entry] for entry in names])

        found = {variable.name: read(variable) for variable in system.variables}
    parameters = [found[variable.name] for variable in system.of_kind(Kind.PARAMETER)]
    if any(values is None for values in parameters):
        return
    p = np.concatenate([values for values in parameters if values is not None])
    x = system.initial(p)
    u = ca.DM.zeros(sum(v.size for v in system.of_kind(Kind.INPUT)))
    for kind, values in (
        (Kind.OUTPUT, system.outputs(x, p)),
        (Kind.STATE, x),
        (Kind.DERIVATIVE, system.rhs(x, u, p)),
    ):
        flat = np.array(values).ravel()
        for variable in system.of_kind(kind):
            expected, flat = flat[: variable.size], flat[variable.size :]
            seen = found[variable.name]
            if seen is None:
                continue
            allowed = AGREEMENT * max(1e-6, float(np.abs(expected).max()))
            for place in np.flatnonzero(~(np.abs(seen - expected) <= allowed)):
                which = variable.scalar_names[int(place)]
                yield error(
                    which, f"found {seen[place]:.17g} at the start, expected {expected[place]:.17g} by the equations"
                )


def memory_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """A restored state is the saved one in every byte.

    Outputs of a short run do not show all of it: not samples under way, nor a filter that has seen too little. Inputs
    change from step to step, and so the memory between the save and the restoring.
    """
    if not interfaces(description)[name].canSerializeFMUstate:
        return
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    rng = np.random.default_rng(1)

    def go_on(instance: Instance) -> None:
        scatter(instance, [v for v in inputs if is_float(v)], rng)
        for flags in [v for v in inputs if not is_float(v)]:
            instance.set([flags], np.ones(size_of(flags)))
        move(instance, 1)

    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        go_on(instance)
        before = instance.save()
        content = instance.serialise(before)
        for _ in range(STEPS):
            go_on(instance)
        instance.restore(before)
        after = instance.save()
        restored = instance.serialise(after)
        for state in (before, after):
            instance.free_state(state)
    wrong = sum(a != b for a, b in zip(content, restored, strict=True))
    if wrong:
        yield error(
            f"{name}/canGetAndSetFMUstate", f"a restored state differs from the saved one in {counted(wrong, 'byte')}"
        )


def _table(description: Any) -> tuple[Variable, ...]:
    shapes = {v.name: (size_of(v) // 3, 3) if v.dimensions else () for v in description.modelVariables}
    return _TABLES[description.modelName](shapes)


def _entries(variable: Variable, description: Any) -> list[tuple[str, Variable, int]]:
    """The variables in the XML that belong to a row of the table: scalars by name, or in FMI 3 the array."""
    whole = any(v.dimensions for v in description.modelVariables)
    if whole:
        return [(variable.name, variable, variable.size)]
    return [(name, variable, 1) for name in variable.scalar_names]


OURS = {"agreement with the model": model_findings, "memory": memory_findings}
"""Checks that run the binary, by title, of units of which more is known than their description tells."""
