"""Parameters that a system's structure binds, inline and in .ssv files, at its components and at the system (SSP 1.0).

Of two values the later one holds, and the system's before a component's. What would change values in a way that is not
followed here, as mappings do, is refused.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from baryscope.fmu.layout.measures import Measure, measure_of
from baryscope.fmu.system.structure import NAMESPACES
from baryscope.models.errors import InputError

BINDINGS = "ssd:ParameterBindings/ssd:ParameterBinding"
SETS = "application/x-ssp-parameter-set"


@dataclass(frozen=True)
class Bound:
    """A value of a parameter, and its unit if one is given; without one it is in the variable's own."""

    value: float
    measure: Measure | None

    def in_unit_of(self, measures: Mapping[str, Measure], name: str) -> float:
        """The value in the unit of a variable; as it is where one of both has none.

        Raises:
            ValueError: the units are of different kinds.
        """
        own = measures.get(name)
        return self.value if self.measure is None or own is None else self.measure.convert(self.value, own)


def bound_parameters(path: Path, folder: Path, root: ET.Element) -> dict[str, dict[str, Bound]]:
    """Values by components and names of variables.

    Args:
        path: the archive, for messages.
        folder: where it is unpacked.
        root: its structure, of one system; fmpy has validated it, and the .ssv files that it names.

    Raises:
        InputError: a value is no number or truth value, or is of no component, or is bound in a way that is refused.
    """
    found: dict[str, dict[str, Bound]] = {}
    for component in root.iterfind("ssd:System/ssd:Elements/ssd:Component", NAMESPACES):
        name = component.get("name", "")
        found[name] = dict(_values(path, folder, component.iterfind(BINDINGS, NAMESPACES), f"{name}."))
    for full, bound in _values(path, folder, root.iterfind(f"ssd:System/{BINDINGS}", NAMESPACES), ""):
        owners = [name for name in found if full.startswith(f"{name}.")]
        if not owners:
            raise InputError(
                f"{path}: binds {full} at the system, expected the name of an element, a dot and a variable"
            )
        owner = max(owners, key=len)
        found[owner][full.removeprefix(f"{owner}.")] = bound
    return found


def _values(path: Path, folder: Path, bindings: Iterable[ET.Element], of: str) -> Iterator[tuple[str, Bound]]:
    """All values of an element's bindings, in order; `of` stands before their names in messages."""
    for binding in bindings:
        what = f"{path}: a parameter binding of {of.removesuffix('.') or 'the system'}"
        if binding.find("ssd:ParameterMapping", NAMESPACES) is not None:
            raise InputError(f"{what} maps its parameters, expected one without a mapping")
        if binding.get("type", SETS) != SETS:
            raise InputError(f"{what} is of type {binding.get('type')}, expected {SETS}")
        for values in _sets(folder, binding, what):
            measures = defined_measures(values, "ssv")
            for parameter in values.iterfind("ssv:Parameters/ssv:Parameter", NAMESPACES):
                name = binding.get("prefix", "") + parameter.get("name", "")
                value = next(iter(parameter), parameter)
                unit = value.get("unit")
                try:
                    number = _number(value.get("value", ""))
                except ValueError as error:
                    found = value.get("value")
                    raise InputError(
                        f"{path}: binds {of}{name} to {found!r}, expected a number, true or false"
                    ) from error
                yield name, Bound(number, None if unit is None else measures.get(unit, Measure(unit)))


def defined_measures(element: ET.Element, space: str) -> dict[str, Measure]:
    """The units that a structure (`ssd`) or a parameter set (`ssv`) defines, by name."""
    found = {}
    for unit in element.iterfind(f"{space}:Units/ssc:Unit", NAMESPACES):
        base = unit.find("ssc:BaseUnit", NAMESPACES)
        found[unit.get("name", "")] = measure_of(unit.get("name", ""), None if base is None else base.attrib)
    return found


def _sets(folder: Path, binding: ET.Element, what: str) -> list[ET.Element]:
    """The <ParameterSet>s of a binding: in its file, or inline."""
    source = binding.get("source")
    if source is None:
        return binding.findall("ssd:ParameterValues/ssv:ParameterSet", NAMESPACES)
    file = folder / source
    if binding.get("sourceBase", "SSD") != "SSD" or not file.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{what} is of {source}, expected a file in the archive")
    return [ET.parse(file).getroot()]  # noqa: S314  fmpy has parsed and validated it


def _number(text: str) -> float:
    return {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else float(text)
