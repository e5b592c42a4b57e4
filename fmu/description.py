"""modelDescription.xml of FMI 2.0, written from the table of variables and CasADi's sparsity."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib.metadata import version

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from baryscope.models.scenario import Scenario
from baryscope.models.target import TumblingTarget
from baryscope.models.variables import UNITS, Kind, Variable

MODEL_NAME = "TumblingTarget"
DESCRIPTION = (
    "A tumbling target on a Keplerian orbit and a chaser near it: attitude, relative motion, "
    "and the target's features as the chaser sees them"
)


def model_description(system: TumblingTarget, parameters: NDArray[np.float64], scenario: Scenario, token: str) -> bytes:
    """The XML file of a Co-Simulation FMU.

    Value references are the places of the scalars in [inputs | parameters | outputs].

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
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=MODEL_NAME,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
    )
    _add_units(root, system)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(categories, "Category", name="logStatusError", description="Why a call was refused or failed")
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


def _scalars(system: TumblingTarget) -> Iterator[tuple[int, str, Variable]]:
    """Value reference, name and table row of every scalar."""
    reference = 0
    for variable in system.variables:
        for name in variable.scalar_names:
            yield reference, name, variable
            reference += 1


_ATTRIBUTES = {
    Kind.INPUT: {"causality": "input", "variability": "continuous"},
    Kind.PARAMETER: {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    Kind.OUTPUT: {"causality": "output", "variability": "continuous", "initial": "calculated"},
}


def _add_variables(root: ET.Element, system: TumblingTarget, parameters: NDArray[np.float64]) -> None:
    inputs = sum(v.size for v in system.of_kind(Kind.INPUT))
    starts = np.concatenate([np.zeros(inputs), parameters])
    parent = ET.SubElement(root, "ModelVariables")
    for reference, name, variable in _scalars(system):
        scalar = ET.SubElement(
            parent,
            "ScalarVariable",
            {"name": name, "valueReference": str(reference), "description": variable.description}
            | _ATTRIBUTES[variable.kind],
        )
        kind = ET.SubElement(scalar, "Boolean" if variable.boolean else "Real")
        if not variable.boolean:
            kind.set("unit", variable.unit)
        if variable.kind != Kind.OUTPUT:
            start = starts[reference]
            kind.set("start", str(bool(start)).lower() if variable.boolean else repr(float(start)))


def _add_structure(root: ET.Element, system: TumblingTarget) -> None:
    """Outputs depend on states and parameters, never on inputs at the same instant; initially on parameters."""
    structure = ET.SubElement(root, "ModelStructure")
    outputs, unknowns = ET.SubElement(structure, "Outputs"), ET.SubElement(structure, "InitialUnknowns")
    inputs = sum(v.size for v in system.of_kind(Kind.INPUT))
    rows = _initial_dependencies(system)
    indices = [reference + 1 for reference, _, v in _scalars(system) if v.kind == Kind.OUTPUT]
    for index, row in zip(indices, rows, strict=True):
        ET.SubElement(outputs, "Unknown", index=str(index), dependencies="")
        known = " ".join(str(inputs + column + 1) for column in row)
        ET.SubElement(unknowns, "Unknown", index=str(index), dependencies=known)


def _initial_dependencies(system: TumblingTarget) -> list[list[int]]:
    """For each output, the parameters it depends on at the start."""
    p = ca.SX.sym("p", system.initial.numel_in())
    pattern = ca.jacobian_sparsity(system.outputs(system.initial(p), p), p)
    rows: list[list[int]] = [[] for _ in range(pattern.size1())]
    for row, column in zip(*pattern.get_triplet(), strict=True):
        rows[row].append(column)
    return [sorted(columns) for columns in rows]
