"""The parts of modelDescription.xml that are specific to FMI 2.0: scalar variables, numbered from 1."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from baryscope.fmu.generate.sources import MAIN
from baryscope.fmu.generate.structure import Structure
from baryscope.fmu.layout.references import Reference, attributes_of, quantity_of, state_of
from baryscope.models.variables import Kind


def add_interfaces(root: ET.Element, model_identifier: str, token: str) -> None:
    """Version, token and capabilities."""
    root.attrib |= {"fmiVersion": "2.0", "guid": token, "numberOfEventIndicators": "0"}
    offered = {
        "modelIdentifier": model_identifier,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    exchange = ET.SubElement(root, "ModelExchange", offered, completedIntegratorStepNotNeeded="true")
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        offered,
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="true",
        maxOutputDerivativeOrder="1",
    )
    for interface in (exchange, simulation):
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
        unknowns = ET.SubElement(parent, element)
        for place, reference in enumerate(references):
            if reference.variable.kind in kinds:
                text = " ".join(str(known + 1) for known in depends[place])
                ET.SubElement(unknowns, "Unknown", index=str(place + 1), dependencies=text)
