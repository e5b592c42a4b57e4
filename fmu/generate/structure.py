"""Dependencies between the unit's values, by CasADi's sparsity: the content of FMI's ModelStructure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from baryscope.fmu.layout.references import Reference
from baryscope.models.target import TumblingTarget
from baryscope.models.variables import Kind

Dependencies = Mapping[int, Sequence[int]]
"""For each unknown, the places of the knowns that it depends on, in increasing order."""


@dataclass(frozen=True)
class Structure:
    """Dependencies in both phases.

    Attributes:
        running: in a run, outputs and derivatives on inputs and states.
        initially: at the start, outputs, states and derivatives on inputs and parameters.
    """

    running: Dependencies
    initially: Dependencies


def structure_of(system: TumblingTarget, references: Sequence[Reference]) -> Structure:
    """The dependencies between value references; an array depends on what any of its scalars depends on."""
    owner = [place for place, reference in enumerate(references) for _ in range(reference.size)]
    running, initially = dependencies(system)
    return Structure(_gathered(running, owner), _gathered(initially, owner))


def _gathered(of_scalars: Dependencies, owner: Sequence[int]) -> dict[int, list[int]]:
    found: dict[int, set[int]] = {}
    for unknown, knowns in of_scalars.items():
        found.setdefault(owner[unknown], set()).update(owner[known] for known in knowns)
    return {unknown: sorted(knowns) for unknown, knowns in found.items()}


def dependencies(system: TumblingTarget) -> tuple[dict[int, list[int]], dict[int, list[int]]]:
    """Dependencies in a run and at the start, as places of scalars in the table of variables."""
    x, u, p = (ca.SX.sym(name, system.rhs.numel_in(index)) for index, name in enumerate("xup"))
    running = _places(
        system,
        {Kind.OUTPUT, Kind.DERIVATIVE},
        {Kind.INPUT, Kind.STATE},
        ca.vertcat(system.outputs(x, p), system.rhs(x, u, p)),
        ca.vertcat(u, x),
    )
    x0 = system.initial(p)
    initially = _places(
        system, {Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE}, {Kind.INPUT, Kind.PARAMETER},
        ca.vertcat(system.outputs(x0, p), x0, system.rhs(x0, u, p)), ca.vertcat(u, p),
    )  # fmt: skip
    return running, initially


def _places(
    system: TumblingTarget, unknown_kinds: set[Kind], known_kinds: set[Kind], unknowns: ca.SX, knowns: ca.SX
) -> dict[int, list[int]]:
    """For each unknown, the knowns that it depends on; `unknowns` and `knowns` are in the order of the table."""
    kinds = [variable.kind for variable in system.variables for _ in range(variable.size)]
    rows = [index for index, kind in enumerate(kinds) if kind in unknown_kinds]
    columns = [index for index, kind in enumerate(kinds) if kind in known_kinds]
    found: dict[int, list[int]] = {row: [] for row in rows}
    pattern = ca.jacobian_sparsity(unknowns, knowns)
    for row, column in zip(*pattern.get_triplet(), strict=True):
        found[rows[row]].append(columns[column])
    return {row: sorted(places) for row, places in found.items()}
