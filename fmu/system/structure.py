"""SystemStructure.ssd of SSP 1.0, in the form that fmpy, libcosim, Ecos and OMSimulator read.

Only connectors that are connected are declared: fmpy hands zeros to others, libcosim and Ecos refuse them. There are no
connectors of the system, no transformations and no unit conversions. Parameters are bound at their components, with the
values that the units start with anyway, for masters that pass over bindings. An annotation tells OMSimulator the step,
without which it does not know what kind of system it is.
"""

import xml.etree.ElementTree as ET

from baryscope import __version__
from baryscope.fmu.system.chain import Chain
from baryscope.models.variables import Kind

NAMESPACES = {
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
}
STRUCTURE = "SystemStructure.ssd"
FMU_TYPE = "application/x-fmu-sharedlibrary"


def source_of(element: str) -> str:
    """The path of an element's unit in the archive."""
    return f"resources/{element}.fmu"


def system_structure(chain: Chain, name: str, stop_time: float) -> bytes:
    """The .ssd of a chain.

    Args:
        chain: units and connections.
        name: of the system.
        stop_time: of the default experiment, s.
    """
    for prefix, uri in NAMESPACES.items():
        ET.register_namespace(prefix, uri)
    root = ET.Element(
        _tag("ssd", "SystemStructureDescription"),
        {"name": name, "version": "1.0", "generationTool": f"baryscope {__version__}"},
    )
    system = ET.SubElement(root, _tag("ssd", "System"), name="loop")
    elements = ET.SubElement(system, _tag("ssd", "Elements"))
    for element in chain.units:
        _add_component(elements, chain, element)
    connections = ET.SubElement(system, _tag("ssd", "Connections"))
    for one in chain.connections:
        for first, second in one.scalars:
            start, end = one.start[0], one.end[0]
            places = {"startElement": start, "startConnector": first, "endElement": end, "endConnector": second}
            ET.SubElement(connections, _tag("ssd", "Connection"), places)
    _annotate(system, min(unit.setting.step_size for unit in chain.units.values()))
    ET.SubElement(root, _tag("ssd", "DefaultExperiment"), startTime="0", stopTime=repr(float(stop_time)))
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def _annotate(system: ET.Element, step: float) -> None:
    """What OMSimulator needs; others pass over it."""
    annotations = ET.SubElement(system, _tag("ssd", "Annotations"))
    annotation = ET.SubElement(annotations, _tag("ssc", "Annotation"), type="org.openmodelica")
    held = ET.SubElement(ET.SubElement(annotation, _tag("oms", "Annotations")), _tag("oms", "SimulationInformation"))
    ET.SubElement(held, _tag("oms", "FixedStepMaster"), description="oms-ma", stepSize=repr(float(step)))


def _add_component(parent: ET.Element, chain: Chain, name: str) -> None:
    """Add a unit of the chain to a system: its connectors as scalars, and its parameters bound to their values."""
    unit = chain.units[name]
    summary = (chain.guests.get(name) or unit).summary
    values = {"name": name, "type": FMU_TYPE, "source": source_of(name), "description": summary}
    component = ET.SubElement(parent, _tag("ssd", "Component"), values)
    connectors = ET.SubElement(component, _tag("ssd", "Connectors"))
    for scalar, variable in chain.connected(name).items():
        kind = "input" if variable.kind == Kind.INPUT else "output"
        connector = ET.SubElement(connectors, _tag("ssd", "Connector"), name=scalar, kind=kind)
        ET.SubElement(connector, _tag("ssc", "Boolean" if variable.boolean else "Real"))
    bindings = ET.SubElement(component, _tag("ssd", "ParameterBindings"))
    binding = ET.SubElement(bindings, _tag("ssd", "ParameterBinding"))
    held = ET.SubElement(binding, _tag("ssd", "ParameterValues"))
    own = ET.SubElement(held, _tag("ssv", "ParameterSet"), version="1.0", name=f"{name}-parameters")
    parameters = ET.SubElement(own, _tag("ssv", "Parameters"))
    for variable in chain.parameters(name):
        for scalar, value in zip(variable.scalar_names, unit.starts[variable.name].ravel(), strict=True):
            parameter = ET.SubElement(parameters, _tag("ssv", "Parameter"), name=scalar)
            if variable.boolean:
                ET.SubElement(parameter, _tag("ssv", "Boolean"), value="true" if value else "false")
            else:
                ET.SubElement(parameter, _tag("ssv", "Real"), value=repr(float(value)))


def _tag(prefix: str, name: str) -> str:
    return f"{{{NAMESPACES[prefix]}}}{name}"
