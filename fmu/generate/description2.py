"""The parts of modelDescription.xml that are specific to FMI 2.0: scalar variables, numbered from 1."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from baryscope.fmu.generate.sources import MAIN
from baryscope.fmu.layout.references import Reference, attributes_of, quantity_of, state_of
from baryscope.fmu.units import Blueprint
from baryscope.fmu.units.structure import Structure
from baryscope.models.variables import Kind


def add_interfaces(root: ET.Element, unit: Blueprint, token: str) -> None:
    """Version, token and capabilities."""
    root.attrib |= {"fmiVersion": "2.0", "guid": token}
    offered = {
        "modelIdentifier": unit.name,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    stepped = {"canHandleVariableCommunicationStepSize": "true"}
    if not unit.is_sampled:
        root.set("numberOfEventIndicators", "0")
        offered["providesDirectionalDerivative"] = "true"
        stepped |= {"canInterpolateInputs": "true", "maxOutputDerivativeOrder": "1"}
        _add_interface(root, "ModelExchange", offered | {"completedIntegratorStepNotNeeded": "true"})
    _add_interface(root, "CoSimulation", offered | stepped)


def _add_interface(root: ET.Element, name: str, attributes: Mapping[str, str]) -> None:
    interface = ET.SubElement(root, name, dict(attributes))
    ET.SubElement(ET.SubElement(interface, "SourceFiles"), "File", name=MAIN)


def add_variables(
    root: ET.Element, references: Sequence[Reference], starts: Mapping[int, str], labels: Sequence[str]
) -> None:
    """A ScalarVariable for every reference; `labels` are those of the features."""
    parent = ET.SubElement(root, "ModelVariables")
    for place, reference in enumerate(references):
        variable = reference.variable
        attributes = {"name": reference.name, "valueReference": str(place)} | attributes_of(reference, labels)
        scalar = ET.SubElement(parent, "ScalarVariable", attributes)
        kind = ET.SubElement(scalar, "Boolean" if variable.boolean else "Real")
        if not variable.boolean:
            kind.attrib |= quantity_of(variable)
        if place in starts:
            kind.set("start", starts[place])
        if variable.kind == Kind.DERIVATIVE:
            kind.set("derivative", str(state_of(references, place) + 1))


def add_structure(root: ET.Element, references: Sequence[Reference], structure: Structure) -> None:
    """The ModelStructure."""
    parent = ET.SubElement(root, "ModelStructure")
    for element, kinds, depends in (
        ("Outputs", {Kind.OUTPUT}, structure.running),
        ("Derivatives", {Kind.DERIVATIVE}, structure.running),
        ("InitialUnknowns", {Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE}, structure.initially),
    ):
        places = [place for place, reference in enumerate(references) if reference.variable.kind in kinds]
        unknowns = ET.SubElement(parent, element) if places else parent  # the schema wants none that is empty
        for place in places:
            text = " ".join(str(known + 1) for known in depends[place])
            ET.SubElement(unknowns, "Unknown", index=str(place + 1), dependencies=text)
