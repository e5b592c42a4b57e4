"""The parts of modelDescription.xml that are specific to FMI 3.0: arrays, the independent variable, adjoints."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from baryscope.fmu.layout.references import Reference, attributes_of, quantity_of, state_of
from baryscope.fmu.units import Blueprint
from baryscope.fmu.units.structure import Structure
from baryscope.models.variables import Kind

TIME_UNIT = "s"


def add_interfaces(root: ET.Element, unit: Blueprint, token: str) -> None:
    """Version, token and capabilities.

    No Event Mode of Co-Simulation, no early return, no intermediate update, no dependencies of single elements.
    """
    root.attrib |= {"fmiVersion": "3.0", "instantiationToken": token}
    offered = {"modelIdentifier": unit.name, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    stepped = {"canHandleVariableCommunicationStepSize": "true"}
    if not unit.is_sampled:
        offered |= {"providesDirectionalDerivatives": "true", "providesAdjointDerivatives": "true"}
        stepped["maxOutputDerivativeOrder"] = "1"
        ET.SubElement(root, "ModelExchange", offered)
    ET.SubElement(root, "CoSimulation", offered | stepped)


def add_variables(
    root: ET.Element, references: Sequence[Reference], starts: Mapping[int, str], labels: Sequence[str]
) -> None:
    """A Float64 or Boolean for every reference, and time; `labels` are those of the features."""
    parent = ET.SubElement(root, "ModelVariables")
    for place, reference in enumerate(references):
        variable = reference.variable
        attributes = {"name": reference.name, "valueReference": str(place)} | attributes_of(reference, labels)
        if not variable.boolean:
            attributes |= quantity_of(variable)
        if place in starts:
            attributes["start"] = starts[place]
        if variable.kind == Kind.DERIVATIVE:
            attributes["derivative"] = str(state_of(references, place))
        element = ET.SubElement(parent, "Boolean" if variable.boolean else "Float64", attributes)
        for extent in reference.shape:
            ET.SubElement(element, "Dimension", start=str(extent))
    ET.SubElement(
        parent,
        "Float64",
        name="time",
        valueReference=str(len(references)),
        description="Simulation time",
        causality="independent",
        variability="continuous",
        unit=TIME_UNIT,
    )


def add_structure(root: ET.Element, references: Sequence[Reference], structure: Structure) -> None:
    """The ModelStructure."""
    parent = ET.SubElement(root, "ModelStructure")
    for element, kinds, depends in (
        ("Output", {Kind.OUTPUT}, structure.running),
        ("ContinuousStateDerivative", {Kind.DERIVATIVE}, structure.running),
        ("InitialUnknown", {Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE}, structure.initially),
    ):
        for place, reference in enumerate(references):
            if reference.variable.kind in kinds:
                text = " ".join(map(str, depends[place]))
                ET.SubElement(parent, element, valueReference=str(place), dependencies=text)
