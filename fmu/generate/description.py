"""modelDescription.xml, from the table of variables and CasADi's sparsity: what both versions of FMI share.

Names of elements and the form of variables differ; they are in description2.py and description3.py.
"""

import xml.etree.ElementTree as ET
from importlib.metadata import version

import baryscope.fmu.generate.description2 as description2
import baryscope.fmu.generate.description3 as description3
from baryscope.fmu.generate.identity import AUTHOR, COPYRIGHT, LICENCE
from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.layout.references import Reference, reference_table
from baryscope.fmu.units import Blueprint
from baryscope.fmu.units.structure import structure_of
from baryscope.models.variables import DISPLAY_UNITS, UNITS

LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed; on by default",
    "logStatusWarning": "What a step has left out, as of bad samples, the first time of each kind; on by default",
    "logEvents": "Initialisation, reset and termination",
}


def model_description(unit: Blueprint, token: str, fmi: FmiVersion = 2, scalar: bool = False) -> bytes:
    """The XML file of an FMU for Co-Simulation and, unless the unit is sampled, Model Exchange.

    Value references are the places in the table of references.

    Args:
        unit: the unit.
        token: the GUID, which FMI 3 calls instantiation token.
        fmi: the version.
        scalar: in FMI 3, describe every scalar by itself, not arrays.
    """
    references = reference_table(unit.variables, fmi, scalar)
    root = ET.Element(
        "fmiModelDescription",
        modelName=unit.name,
        description=unit.summary,
        author=AUTHOR,
        copyright=COPYRIGHT,
        license=LICENCE,
        version=version("baryscope"),
        generationTool=f"baryscope {version('baryscope')}",
        variableNamingConvention="structured",
    )
    writer = description3 if fmi == 3 else description2
    writer.add_interfaces(root, unit, token)
    _add_units(root, unit, fmi)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    setting = unit.setting
    experiment = {
        "startTime": 0.0,
        "stopTime": setting.stop_time,
        "tolerance": unit.tolerance,
        "stepSize": setting.step_size,
    }
    given = {name: repr(float(value)) for name, value in experiment.items() if value is not None}
    ET.SubElement(root, "DefaultExperiment", given)
    writer.add_variables(root, references, _starts(references, unit), setting.labels)
    writer.add_structure(root, references, structure_of(unit, references, fmi))
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document


def _add_units(root: ET.Element, unit: Blueprint, fmi: FmiVersion) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    floats = [variable for variable in unit.variables if not variable.boolean]
    used = {variable.unit for variable in floats} | ({description3.TIME_UNIT} if fmi == 3 else set())
    displayed = {(variable.unit, variable.display_unit) for variable in floats}
    for name, exponents in UNITS.items():
        if name in used:
            element = ET.SubElement(definitions, "Unit", name=name)
            ET.SubElement(element, "BaseUnit", {base: str(power) for base, power in exponents.items()})
            for display, factor in DISPLAY_UNITS.get(name, {}).items():
                if (name, display) in displayed:
                    ET.SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def _starts(references: list[Reference], unit: Blueprint) -> dict[int, str]:
    """The start attributes, with all digits, by value reference."""
    starts = {}
    for place, reference in enumerate(references):
        variable = reference.variable
        if variable.name in unit.starts:
            values = unit.starts[variable.name].ravel().tolist()
            own = values if reference.element is None else [values[reference.element]]
            starts[place] = " ".join(str(bool(v)).lower() if variable.boolean else repr(v) for v in own)
    return starts
