"""Checks of units: definitions against names, derivatives against states, and elements of one array."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

from baryscope.fmu.check.finding import Finding, error, warning
from baryscope.fmu.layout.measures import BASES

Exponents = Mapping[str, int]

# Coherent SI symbols in base units. Other symbols, such as prefixed ones, are not checked.
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    **{base: {base: 1} for base in BASES},
    "Hz": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "S": {"kg": -1, "m": -2, "s": 3, "A": 2},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "T": {"kg": 1, "s": -2, "A": -1},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
}
_FACTOR = re.compile(r"([A-Za-z]+|1)\^?([+-]?\d+)?")


def exponents_of_name(name: str) -> Exponents | None:
    """The exponents of the base units in a name such as `kg.m2/s` or `N.m/(rad.s)`; None if it is not SI."""
    total: Counter[str] = Counter()
    halves = name.replace("(", "").replace(")", "").split("/")
    if len(halves) > 2 or ("/" in name and "." in halves[1] and "(" not in name):
        return None  # a second slash, or a dot after a slash, is ambiguous
    for sign, half in zip((1, -1), halves, strict=False):
        for factor in re.split(r"[.*]", half):
            match = _FACTOR.fullmatch(factor)
            if match is None or match[1] not in _SYMBOLS:
                return None
            for base, power in _SYMBOLS[match[1]].items():
                total[base] += sign * power * int(match[2] or 1)
    return {base: power for base, power in total.items() if power}


def exponents_of_definition(base_unit: Any) -> Exponents:
    """The exponents that a <BaseUnit> declares."""
    return {base: power for base in BASES if (power := int(getattr(base_unit, base) or 0))}


def unit_of(variable: Any) -> str | None:
    """The unit of a variable, its own or its type's."""
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return None if unit is None else str(unit)


def display_unit_of(variable: Any) -> str | None:
    """The display unit of a variable, its own or its type's."""
    unit = variable.displayUnit or (variable.declaredType.displayUnit if variable.declaredType is not None else None)
    return None if unit is None else str(unit)


def unit_findings(description: Any) -> Iterator[Finding]:
    """All checks of units."""
    bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions if unit.baseUnit is not None}
    for name, base in bases.items():
        expected = exponents_of_name(name)
        if expected is None:
            continue
        found = exponents_of_definition(base)
        if found != expected:
            yield error(f'unit "{name}"', f"found exponents {_text(found)}, expected {_text(expected)}")
        elif float(base.factor or 1) != 1.0 or float(base.offset or 0) != 0.0:
            yield error(f'unit "{name}"', f"found factor {base.factor} and offset {base.offset}, expected 1 and 0")
    for variable in description.modelVariables:
        if variable.derivative is not None:
            yield from _derivative_findings(variable, bases)
    yield from _array_findings(description.modelVariables)


def _derivative_findings(variable: Any, bases: Mapping[str, Any]) -> Iterator[Finding]:
    """The unit of a derivative is that of its state per second."""
    state = variable.derivative
    own, of_state = unit_of(variable), unit_of(state)
    if own is None or of_state is None or own not in bases or of_state not in bases:
        return
    expected = Counter(exponents_of_definition(bases[of_state]))
    expected["s"] -= 1
    wanted = {base: power for base, power in expected.items() if power}
    found = exponents_of_definition(bases[own])
    if found != wanted:
        yield error(
            variable.name,
            f'found unit "{own}" ({_text(found)}), expected {_text(wanted)}, since {state.name} has "{of_state}"',
        )


def _array_findings(variables: Any) -> Iterator[Finding]:
    """Elements of one array that are declared as scalars, `x[1]`, `x[2]`, have the same unit."""

    def stem(variable: Any) -> str:
        return re.sub(r"\[[\d,]+\](?=\)?$)", "[]", variable.name)

    for name, group in groupby(variables, key=stem):
        if not name.endswith(("[]", "[])")):
            continue
        members = list(group)
        units = Counter(unit_of(member) for member in members)
        usual, _ = units.most_common(1)[0]
        for member in members:
            if unit_of(member) != usual:
                yield warning(member.name, f'found unit "{unit_of(member)}", expected "{usual}" as in its neighbours')


def _text(exponents: Exponents) -> str:
    return ", ".join(f"{base}={exponents[base]}" for base in BASES if base in exponents) or "none"
