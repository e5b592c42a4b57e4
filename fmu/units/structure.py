"""Dependencies between a unit's values: the content of FMI's ModelStructure."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.layout.references import Reference
from baryscope.fmu.units.blueprint import Blueprint, Dependencies
from baryscope.models.target import TumblingTarget
from baryscope.models.variables import Kind


@dataclass(frozen=True)
class Structure:
    """Dependencies in both phases.

    Attributes:
        running: in a run, outputs and derivatives on inputs and states, and in FMI 3 on tunable parameters.
        initially: at the start, outputs, states and derivatives on inputs and parameters.
    """

    running: Dependencies
    initially: Dependencies


def structure_of(unit: Blueprint, references: Sequence[Reference], fmi: FmiVersion) -> Structure:
    """The dependencies between value references; an array depends on what any of its scalars depends on."""
    owner = [place for place, reference in enumerate(references) for _ in range(reference.size)]
    running, initially = unit.dependencies(fmi) if unit.dependencies else _of_steps_done(unit)
    return Structure(_gathered(running, owner), _gathered(initially, owner))


def _gathered(of_scalars: Dependencies, owner: Sequence[int]) -> dict[int, list[int]]:
    found: dict[int, set[int]] = {}
    for unknown, knowns in of_scalars.items():
        found.setdefault(owner[unknown], set()).update(owner[known] for known in knowns)
    return {unknown: sorted(knowns) for unknown, knowns in found.items()}


def _of_steps_done(unit: Blueprint) -> tuple[Dependencies, Dependencies]:
    scalars = [variable for variable in unit.variables for _ in range(variable.size)]
    free: Dependencies = {place: [] for place, variable in enumerate(scalars) if variable.kind == Kind.OUTPUT}
    return free, free


def dependencies(system: TumblingTarget, fmi: FmiVersion) -> tuple[Dependencies, Dependencies]:
    """Dependencies in a run and at the start, as places of scalars in the table of variables.

    FMI 3.0 (2.4.8) lists parameters among the knowns of a run, and leaves out of an output's dependencies what is
    frozen then, as fixed ones are: tunable ones remain. FMI 2.0 counts no parameters.
    """
    scalars = [variable for variable in system.variables for _ in range(variable.size)]
    x, u, p = (ca.SX.sym(name, system.rhs.numel_in(index)) for index, name in enumerate("xup"))

    def of_kinds(*kinds: Kind) -> list[int]:
        return [place for place, variable in enumerate(scalars) if variable.kind in kinds]

    parameters = of_kinds(Kind.PARAMETER)
    tuned = [k for k, place in enumerate(parameters) if scalars[place].tunable and fmi == 3]
    in_run = [*of_kinds(Kind.INPUT), *(parameters[k] for k in tuned), *of_kinds(Kind.STATE)]
    running = _depending(
        ca.vertcat(system.outputs(x, p), system.rhs(x, u, p)), of_kinds(Kind.OUTPUT, Kind.DERIVATIVE),
        ca.vertcat(u, p[tuned], x), in_run,
    )  # fmt: skip
    x0 = system.initial(p)
    initially = _depending(
        ca.vertcat(system.outputs(x0, p), x0, system.rhs(x0, u, p)),
        of_kinds(Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE),
        ca.vertcat(u, p), [*of_kinds(Kind.INPUT), *parameters],
    )  # fmt: skip
    return running, initially


def _depending(unknowns: ca.SX, rows: list[int], knowns: ca.SX, columns: list[int]) -> Dependencies:
    """For each unknown, the knowns that it depends on; `rows` and `columns` are their places."""
    found: dict[int, list[int]] = {row: [] for row in rows}
    for row, column in zip(*ca.jacobian_sparsity(unknowns, knowns).get_triplet(), strict=True):
        found[rows[row]].append(columns[column])
    return {row: sorted(places) for row, places in found.items()}
