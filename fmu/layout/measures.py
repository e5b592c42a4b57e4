"""Units of measurement as FMI and SSP define them: exponents of the SI's base units, a factor and an offset."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_KINDS = BASES[:-1]  # tools differ in whether an angle, or a rate, counts rad


@dataclass(frozen=True)
class Measure:
    """A unit: its name and, where it is defined, what it is in base units, factor · value + offset.

    Attributes:
        name: as a variable or a parameter gives it.
        exponents: of BASES but rad; None if it is not defined.
        factor: into base units.
        offset: in base units.
    """

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0

    def convert(self, value: float, to: "Measure") -> float:
        """A value in another unit; what has its name is the same.

        Raises:
            ValueError: it is of another kind, or one of both is not defined.
        """
        if self.name == to.name and None in (self.exponents, to.exponents):
            return value
        if self.exponents is None or self.exponents != to.exponents:
            raise ValueError(f'in "{self.name}", expected "{to.name}"')
        if (self.factor, self.offset) == (to.factor, to.offset):
            return value
        return (self.factor * value + self.offset - to.offset) / to.factor

    def is_same(self, other: "Measure") -> bool:
        """Whether values in it are values in the other unit."""
        try:
            return all(self.convert(value, other) == value for value in (0.0, 1.0))
        except ValueError:
            return False


def measure_of(name: str, definition: Mapping[str, Any] | None) -> Measure:
    """A unit by the attributes of its <BaseUnit>, None if it has none."""
    if definition is None:
        return Measure(name)
    exponents = tuple(int(definition.get(base) or 0) for base in _KINDS)
    return Measure(name, exponents, float(definition.get("factor") or 1.0), float(definition.get("offset") or 0.0))


def measures_of(description: Any) -> dict[str, Measure]:
    """The units of the variables that have one, by the variables' names, from fmpy's reading of a description."""
    keys = (*BASES, "factor", "offset")
    defined = {
        unit.name: measure_of(unit.name, unit.baseUnit and {key: getattr(unit.baseUnit, key) for key in keys})
        for unit in description.unitDefinitions
    }
    found = {}
    for variable in description.modelVariables:
        declared = variable.declaredType
        name = variable.unit or (declared.unit if declared is not None else None)
        if name:
            found[variable.name] = defined.get(name, Measure(name))
    return found
