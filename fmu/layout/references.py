"""Value references, by which importers get and set values, and the variables behind them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.models.variables import Kind, Variable


@dataclass(frozen=True)
class Reference:
    """The variable, or part of one, behind a value reference. The reference is the place in the table of references.

    Attributes:
        name: of a scalar, or in FMI 3 of an array.
        variable: its row in the table of variables.
        offset: place of its first scalar in the unit's values.
        size: number of scalars.
        shape: of an array; () for a scalar.
        element: place of a scalar in its variable; None for a whole variable.
    """

    name: str
    variable: Variable
    offset: int
    size: int
    shape: tuple[int, ...]
    element: int | None = None


def reference_table(variables: Sequence[Variable], fmi: FmiVersion = 2, scalar: bool = False) -> list[Reference]:
    """The table of references: a whole variable each in FMI 3; a scalar each in FMI 2, or if `scalar`.

    In FMI 3 one more reference follows, that of the independent variable, time.
    """
    table: list[Reference] = []
    offset = 0
    for variable in variables:
        if fmi == 3 and not scalar:
            table.append(Reference(variable.name, variable, offset, variable.size, variable.shape))
        else:
            names = enumerate(variable.scalar_names)
            table += [Reference(name, variable, offset + k, 1, (), k) for k, name in names]
        offset += variable.size
    return table


def state_of(references: Sequence[Reference], place: int) -> int:
    """The reference of the state whose derivative stands at `place`."""
    name = references[place].name.removeprefix("der(").removesuffix(")")
    return next(index for index, reference in enumerate(references) if reference.name == name)


_ATTRIBUTES = {
    Kind.INPUT: {"causality": "input"},
    Kind.PARAMETER: {"causality": "parameter", "initial": "exact"},
    Kind.OUTPUT: {"causality": "output", "initial": "calculated"},
    Kind.STATE: {"causality": "local", "initial": "approx"},
    Kind.DERIVATIVE: {"causality": "local", "initial": "calculated"},
}


def attributes_of(reference: Reference, labels: Sequence[str]) -> dict[str, str]:
    """The attributes in modelDescription.xml that both versions of FMI have; `labels` are those of the features."""
    variable, element = reference.variable, reference.element
    if element is None:
        description = variable.whole_description(labels)
    else:
        description = variable.scalar_description(element, labels)
    attributes = {"description": description} | _ATTRIBUTES[variable.kind]
    return attributes | {"variability": variability_of(variable)}


def variability_of(variable: Variable) -> str:
    """FMI's variability of a variable."""
    if variable.kind == Kind.PARAMETER:
        return "tunable" if variable.tunable else "fixed"
    return "discrete" if variable.discrete else "continuous"


def quantity_of(variable: Variable) -> dict[str, str]:
    """The attributes of a float's type that both versions have: units and limits."""
    smallest, largest = variable.limits
    given = {
        "unit": variable.unit,
        "displayUnit": variable.display_unit if variable.display_unit != variable.unit else None,
        "min": repr(smallest) if isfinite(smallest) else None,
        "max": repr(largest) if isfinite(largest) else None,
    }
    return {name: value for name, value in given.items() if value is not None}
