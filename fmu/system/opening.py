"""A system in an .ssp archive, read, checked and made ready to be stepped: its units, their values and connections."""

import os
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.ssp.ssd import Component, read_ssd

from baryscope.fmu.layout.archive import UNUSED, unpack
from baryscope.fmu.layout.measures import Measure, measures_of
from baryscope.fmu.layout.whole import refuse_cut_unit
from baryscope.fmu.runtime.instance import UnitError
from baryscope.fmu.runtime.loading import loaded
from baryscope.fmu.system.bindings import Bound, bound_parameters, defined_measures
from baryscope.fmu.system.master import Bundle, Master, Unit
from baryscope.fmu.system.structure import NAMESPACES, STRUCTURE
from baryscope.models.errors import InputError
from baryscope.models.files import temporary_folder

EXPECTED = "a system of FMI 2.0 units, SSP 1.0, made by `baryscope system`"
SHORTEST_STEP = 1e-6  # s, of a master
WARNING, ERROR = 1, 3  # of FMI's statuses; from the second on they are errors

Link = tuple[str, str, str, str]  # element and scalar, of start and end


def refuse_step(step_size: float | None) -> None:
    """Check a master's step, s, if there is one.

    Raises:
        InputError: it is too short.
    """
    if step_size is not None and not step_size >= SHORTEST_STEP:
        raise InputError(f"step: found {step_size:g} s, expected at least {SHORTEST_STEP:g} s")


@contextmanager
def open_system(path: Path, step_size: float | None = None) -> Iterator[Master]:
    """A master of the system in an .ssp archive, initialised.

    Args:
        path: the archive.
        step_size: of all steps, s; None: the shortest of the units' own.

    Raises:
        InputError: it cannot be read, is unsafe, or is no system of FMI 2.0 units for Co-Simulation.
        DiskError: there is no room to unpack it.
        UnitError: a unit refuses its parameters.
    """
    refuse_step(step_size)
    opened: dict[str, Unit] = {}
    with temporary_folder() as top:
        folder = top / "archive"
        folder.mkdir()
        try:
            unpack(path, folder, EXPECTED)
            components, links = _structure(path)
            root = ET.parse(folder / STRUCTURE).getroot()  # noqa: S314  fmpy has parsed and validated it
            _refuse_transformations(path, root)
            stop_time = _stop_time(path, root)
            bound = bound_parameters(path, folder, root)
            for component in components:
                # A name may be any text, and the archive may have a folder of that name.
                place = top / f"unit-{len(opened)}"
                opened[component.name] = _opened(path, folder, component, bound[component.name], place)
            _refuse_other_measures(path, opened, root)
            master = Master(opened, _bundles(path, opened, links), stop_time)
            if step_size is not None:
                master.step_size = step_size
            yield master
        finally:
            for unit in opened.values():
                unit.fmu.freeInstance()


def _structure(path: Path) -> tuple[list[Component], list[Link]]:
    """The components of an .ssd, and its connections between two of them.

    Raises:
        InputError: it cannot be read, or has elements of one name, or systems in the system.
    """
    try:
        description = read_ssd(str(path))
    except Exception as error:  # fmpy raises bare Exceptions
        raise InputError(f"{path}: {' '.join(str(error).split())}, expected {EXPECTED}") from error
    components = list(description.system.elements)
    names = [element.name for element in components]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}: {twice} stands twice, expected elements of different names")
    strangers = [element.name for element in components if not isinstance(element, Component)]
    if strangers:
        raise InputError(f"{path}: {strangers[0]} is a system in the system, expected {EXPECTED}")
    links = [
        (one.startElement or "", one.startConnector, one.endElement or "", one.endConnector)
        for one in description.system.connections
    ]
    return components, links


def _refuse_transformations(path: Path, root: ET.Element) -> None:
    """Refuse values that are transformed where they are connected, which fmpy passes over."""
    if any(element.tag.endswith("Transformation") for element in root.iter()):
        raise InputError(f"{path}: a connection transforms its values, expected {EXPECTED}")


def _stop_time(path: Path, root: ET.Element) -> float | None:
    """The stop time of the default experiment, which fmpy passes over, s; None if there is none.

    Raises:
        InputError: the start is not 0.
    """
    experiment = root.find("ssd:DefaultExperiment", NAMESPACES)
    if experiment is None:
        return None
    if float(experiment.get("startTime", "0")) != 0.0:
        raise InputError(f"{path}: starts at {experiment.get('startTime')} s, expected 0 s")
    stop = experiment.get("stopTime")
    return None if stop is None else float(stop)


def _refuse_other_measures(path: Path, units: Mapping[str, Unit], root: ET.Element) -> None:
    """Refuse a connection of values in different units: SSP asks masters to convert them, and this one does not."""
    defined = defined_measures(root, "ssd")
    given = {
        (component.get("name"), connector.get("name")): real.get("unit")
        for component in root.iterfind("ssd:System/ssd:Elements/ssd:Component", NAMESPACES)
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES)
        for real in connector.iterfind("ssc:Real", NAMESPACES)
    }

    def measure(element: str, scalar: str) -> Measure | None:
        name = given.get((element, scalar))
        own = units[element].measures.get(scalar) if element in units else None
        return own if name is None else defined.get(name, Measure(name))

    for one in root.iterfind("ssd:System/ssd:Connections/ssd:Connection", NAMESPACES):
        first, second = ((one.get(f"{end}Element", ""), one.get(f"{end}Connector", "")) for end in ("start", "end"))
        start, end = measure(*first), measure(*second)
        if one.get("suppressUnitConversion") in ("true", "1") or start is None or end is None or start.is_same(end):
            continue
        raise InputError(
            f'{path}: connects {".".join(first)} in "{start.name}" to {".".join(second)} in "{end.name}", '
            "expected one unit: no values are converted here"
        )


def _opened(path: Path, folder: Path, component: Component, bound: Mapping[str, Bound], place: Path) -> Unit:
    """An instance of a component's unit in the folder of an archive, with its parameters; unpacked in a new place."""
    where = folder / component.source
    if not where.resolve().is_relative_to(folder.resolve()) or not where.is_file():
        raise InputError(f"{path}: {component.name} is of {component.source}, expected a file in the archive")
    place.mkdir()
    source = f"{path}: {component.source}"
    unpack(where, place, EXPECTED, source, UNUSED)
    try:
        description = fmpy.read_model_description(str(place), validate=False)
    except Exception as error:  # fmpy raises bare Exceptions
        raise InputError(f"{source}: {' '.join(str(error).split())}, expected {EXPECTED}") from error
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        raise InputError(f"{path}: {component.name} is of FMI {description.fmiVersion}, expected {EXPECTED}")
    refuse_cut_unit(place, description.coSimulation.modelIdentifier, source)
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    measures = measures_of(description)
    parameters = _parameters(path, component.name, bound, references, measures)
    fmu, messages = _instantiated(component.name, description, place)
    experiment = description.defaultExperiment
    scalars = description.modelVariables
    return Unit(
        name=component.name,
        model=description.modelName,
        references=references,
        booleans=frozenset(scalar.name for scalar in scalars if scalar.type == "Boolean"),
        integers=frozenset(scalar.name for scalar in scalars if scalar.type in ("Integer", "Enumeration")),
        step_size=None if experiment is None or experiment.stepSize is None else float(experiment.stepSize),
        fmu=fmu,
        messages=messages,
        parameters=parameters,
        measures=measures,
        descriptions={scalar.name: scalar.description for scalar in scalars if scalar.description},
    )


def _instantiated(name: str, description: Any, folder: Path) -> tuple[Any, list[str]]:
    """An instance of an unpacked unit, and the list to which it adds the errors that it logs; warnings go on."""
    messages: list[str] = []

    def log(*call: Any) -> None:
        text = " ".join(call[4].decode("utf-8", "replace").split())
        if call[2] >= ERROR:
            messages.append(text)
        elif call[2] == WARNING:
            warnings.warn(f"{name}: {text}", stacklevel=2)

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(log)
    try:
        fmu = loaded(
            FMU2Slave,
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        fmu.instantiate(callbacks=callbacks, loggingOn=True)  # fmpy keeps a reference to the callbacks
    except Exception as error:  # fmpy raises bare Exceptions
        text = str(error).replace(f"{folder}{os.sep}", "")  # a temporary one
        raise UnitError(f"{name}: {'; '.join(messages) or text}") from error
    return fmu, messages


def _parameters(
    path: Path, component: str, bound: Mapping[str, Bound], known: Collection[str], measures: Mapping[str, Measure]
) -> dict[str, float]:
    """The values that are bound at a component, in the units of its unit's variables, the `known` scalars.

    Raises:
        InputError: one is bound to no scalar, or is in a unit of another kind.
    """
    found = {}
    for name, value in bound.items():
        place = f"{path}: binds {component}.{name}"
        if name not in known:
            raise InputError(f"{place}, which is not in its unit, expected {EXPECTED}")
        try:
            found[name] = value.in_unit_of(measures, name)
        except ValueError as error:
            raise InputError(f"{place} {error}") from error
    return found


def _bundles(path: Path, units: Mapping[str, Unit], links: Sequence[Link]) -> list[Bundle]:
    """Connections of scalars of one type between the same units, together."""
    groups: dict[tuple[str, str, bool], list[Link]] = {}
    fed: set[tuple[str, str]] = set()
    for link in links:
        start, output, end, taken = link
        for element, scalar in ((start, output), (end, taken)):
            if element not in units or scalar not in units[element].references:
                raise InputError(f"{path}: connects {element}.{scalar}, which is in no unit, expected {EXPECTED}")
        if (end, taken) in fed:
            raise InputError(f"{path}: connects two outputs to {end}.{taken}, expected one")
        fed.add((end, taken))
        groups.setdefault((start, end, output in units[start].booleans), []).append(link)
    return [
        Bundle(start, tuple(link[1] for link in own), end, tuple(link[3] for link in own))
        for (start, end, _), own in groups.items()
    ]
