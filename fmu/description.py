"""modelDescription.xml of FMI 2.0, written from the table of variables and CasADi's sparsity."""

import xml.etree.ElementTree as ET
from importlib.metadata import version

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.fmu.codegen import reference_table
from baryscope.models.scenario import Scenario
from baryscope.models.target import TumblingTarget
from baryscope.models.variables import UNITS, Kind

MODEL_NAME = "TumblingTarget"
DESCRIPTION = (
    "A tumbling target on a Keplerian orbit and a chaser near it: attitude, relative motion, "
    "and the target's features as the chaser sees them"
)

LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed; on unless switched off",
    "logEvents": "Initialisation, reset and termination",
}


def model_description(system: TumblingTarget, parameters: NDArray[np.float64], scenario: Scenario, token: str) -> bytes:
    """The XML file of an FMU for Co-Simulation and Model Exchange.

    Value references are the places of the scalars in the table of variables.

    Args:
        system: the symbolic system.
        parameters: start values, flat.
        scenario: gives the default experiment.
        token: the GUID.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=MODEL_NAME,
        guid=token,
        description=DESCRIPTION,
        version=version("baryscope"),
        generationTool=f"baryscope {version('baryscope')}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    offered = {
        "modelIdentifier": MODEL_NAME,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    ET.SubElement(root, "ModelExchange", offered, completedIntegratorStepNotNeeded="true")
    ET.SubElement(
        root,
        "CoSimulation",
        offered,
        canHandleVariableCommunicationStepSize="true",
        maxOutputDerivativeOrder="1",
    )
    _add_units(root, system)
    categories = ET.SubElement(root, "LogCategories")
    for name, meaning in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=meaning)
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(float(scenario.duration)),
        tolerance=repr(scenario.run.tolerance),
        stepSize=repr(scenario.run.sample_time),
    )
    _add_variables(root, system, parameters)
    _add_structure(root, system)
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def _add_units(root: ET.Element, system: TumblingTarget) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    used = {variable.unit for variable in system.variables}
    for name, exponents in UNITS.items():
        if name in used:
            unit = ET.SubElement(definitions, "Unit", name=name)
            ET.SubElement(unit, "BaseUnit", {base: str(power) for base, power in exponents.items()})


_ATTRIBUTES = {
    Kind.INPUT: {"causality": "input", "variability": "continuous"},
    Kind.PARAMETER: {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    Kind.OUTPUT: {"causality": "output", "variability": "continuous", "initial": "calculated"},
    Kind.STATE: {"causality": "local", "variability": "continuous", "initial": "calculated"},
    Kind.DERIVATIVE: {"causality": "local", "variability": "continuous", "initial": "calculated"},
}


def _add_variables(root: ET.Element, system: TumblingTarget, parameters: NDArray[np.float64]) -> None:
    starts = np.concatenate([np.zeros(sum(v.size for v in system.of_kind(Kind.INPUT))), parameters])
    parent = ET.SubElement(root, "ModelVariables")
    first_of = {kind: index for index, kind in reversed(list(enumerate(_kinds(system))))}
    for reference in reference_table(system):
        variable = reference.variable
        attributes = {"name": reference.name, "valueReference": str(reference.offset)}
        attributes |= {"description": variable.description} | _ATTRIBUTES[variable.kind]
        if variable.tunable:
            attributes["variability"] = "tunable"
        scalar = ET.SubElement(parent, "ScalarVariable", attributes)
        kind = ET.SubElement(scalar, "Boolean" if variable.boolean else "Real")
        if not variable.boolean:
            kind.set("unit", variable.unit)
        if variable.kind in (Kind.INPUT, Kind.PARAMETER):
            start = starts[reference.offset]
            kind.set("start", str(bool(start)).lower() if variable.boolean else repr(float(start)))
        if variable.kind == Kind.DERIVATIVE:
            state = first_of[Kind.STATE] + reference.offset - first_of[Kind.DERIVATIVE]
            kind.set("derivative", str(state + 1))


def _kinds(system: TumblingTarget) -> list[Kind]:
    """The kind of every scalar, by its place in the table."""
    return [reference.variable.kind for reference in reference_table(system)]


def _add_structure(root: ET.Element, system: TumblingTarget) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    running, initially = dependencies(system)
    kinds = _kinds(system)
    for element, wanted, known in (
        ("Outputs", {Kind.OUTPUT}, running),
        ("Derivatives", {Kind.DERIVATIVE}, running),
        ("InitialUnknowns", {Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE}, initially),
    ):
        parent = ET.SubElement(structure, element)
        for index, kind in enumerate(kinds):
            if kind in wanted:
                text = " ".join(str(place + 1) for place in known[index])
                ET.SubElement(parent, "Unknown", index=str(index + 1), dependencies=text)


def dependencies(system: TumblingTarget) -> tuple[dict[int, list[int]], dict[int, list[int]]]:
    """What depends on what, by CasADi's sparsity, as places of scalars in the table of variables.

    Returns:
        In a run: outputs and derivatives on inputs and states. At the start: outputs, states and derivatives on inputs
        and parameters.
    """
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
    """For each unknown the knowns it depends on; `unknowns` and `knowns` in the order of the table."""
    kinds = _kinds(system)
    rows = [index for index, kind in enumerate(kinds) if kind in unknown_kinds]
    columns = [index for index, kind in enumerate(kinds) if kind in known_kinds]
    found: dict[int, list[int]] = {row: [] for row in rows}
    pattern = ca.jacobian_sparsity(unknowns, knowns)
    for row, column in zip(*pattern.get_triplet(), strict=True):
        found[rows[row]].append(columns[column])
    return {row: sorted(places) for row, places in found.items()}
