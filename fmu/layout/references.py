"""Value references: the numbers by which importers ask for values, and what each of them stands for."""

from collections.abc import Sequence
from dataclasses import dataclass

from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.models.variables import Kind, Variable


@dataclass(frozen=True)
class Reference:
    """What a value reference, its place in the table of references, stands for.

    Attributes:
        name: of a scalar, or in FMI 3 of an array.
        variable: the row of the table of variables that it is, or is part of.
        offset: place of its first scalar in the unit's values.
        size: how many scalars it has.
        shape: of an array; () for a scalar.
    """

    name: str
    variable: Variable
    offset: int
    size: int
    shape: tuple[int, ...]


def reference_table(variables: Sequence[Variable], fmi: FmiVersion = 2, scalar: bool = False) -> list[Reference]:
    """What value references stand for: every variable, whole, in FMI 3; every scalar in FMI 2, or if `scalar`.

    In FMI 3 one more reference follows, that of the independent variable, time.
    """
    table: list[Reference] = []
    offset = 0
    for variable in variables:
        if fmi == 3 and not scalar:
            table.append(Reference(variable.name, variable, offset, variable.size, variable.shape))
        else:
            names = enumerate(variable.scalar_names)
            table += [Reference(name, variable, offset + k, 1, ()) for k, name in names]
        offset += variable.size
    return table


def state_of(references: Sequence[Reference], place: int) -> int:
    """The reference of the state whose derivative stands at `place`."""
    name = references[place].name.removeprefix("der(").removesuffix(")")
    return next(index for index, reference in enumerate(references) if reference.name == name)


_ATTRIBUTES = {
    Kind.INPUT: {"causality": "input", "variability": "continuous"},
    Kind.PARAMETER: {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    Kind.OUTPUT: {"causality": "output", "variability": "continuous", "initial": "calculated"},
    Kind.STATE: {"causality": "local", "variability": "continuous", "initial": "calculated"},
    Kind.DERIVATIVE: {"causality": "local", "variability": "continuous", "initial": "calculated"},
}


def attributes_of(variable: Variable) -> dict[str, str]:
    """What a variable is to an importer, as attributes of modelDescription.xml that both versions have."""
    attributes = {"description": variable.description} | _ATTRIBUTES[variable.kind]
    return attributes | ({"variability": "tunable"} if variable.tunable else {})
