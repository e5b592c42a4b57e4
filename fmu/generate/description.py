"""modelDescription.xml, from the table of variables and CasADi's sparsity: what both versions of FMI share.

Names of elements and the form of variables differ; they are in description2.py and description3.py.
"""

import xml.etree.ElementTree as ET
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

import baryscope.fmu.generate.description2 as description2
import baryscope.fmu.generate.description3 as description3
from baryscope.fmu.generate.identity import AUTHOR, COPYRIGHT, DESCRIPTION, LICENCE, labels_of
from baryscope.fmu.generate.structure import structure_of
from baryscope.fmu.layout.archive import MODEL_NAME
from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.layout.references import Reference, reference_table
from baryscope.models.scenario import Scenario
from baryscope.models.target import TumblingTarget
from baryscope.models.variables import DISPLAY_UNITS, UNITS, Kind

EXPERIMENT_TOLERANCE = 1e-6  # for the importer's own solver in Model Exchange; the unit keeps solver.tolerance

LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed; on by default",
    "logEvents": "Initialisation, reset and termination",
}


def model_description(
    system: TumblingTarget,
    parameters: NDArray[np.float64],
    scenario: Scenario,
    token: str,
    fmi: FmiVersion = 2,
    scalar: bool = False,
) -> bytes:
    """The XML file of an FMU for Co-Simulation and Model Exchange.

    Value references are the places in the table of references.

    Args:
        system: the symbolic system.
        parameters: start values, flat.
        scenario: gives the default experiment.
        token: the GUID, which FMI 3 calls instantiation token.
        fmi: the version.
        scalar: in FMI 3, describe every scalar by itself, not arrays.
    """
    references = reference_table(system.variables, fmi, scalar)
    structure = structure_of(system, references, fmi)
    root = ET.Element(
        "fmiModelDescription",
        modelName=MODEL_NAME,
        description=DESCRIPTION,
        author=AUTHOR,
        copyright=COPYRIGHT,
        license=LICENCE,
        version=version("baryscope"),
        generationTool=f"baryscope {version('baryscope')}",
        variableNamingConvention="structured",
    )
    writer = description3 if fmi == 3 else description2
    writer.add_interfaces(root, MODEL_NAME, token)
    _add_units(root, system, fmi)
    categories = ET.SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=text)
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime="0.0",
        stopTime=repr(float(scenario.duration)),
        tolerance=repr(max(EXPERIMENT_TOLERANCE, scenario.run.tolerance)),
        stepSize=repr(scenario.run.sample_time),
    )
    writer.add_variables(root, references, _starts(references, system, parameters), labels_of(scenario))
    writer.add_structure(root, references, structure)
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document


def _add_units(root: ET.Element, system: TumblingTarget, fmi: FmiVersion) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    used = {variable.unit for variable in system.variables} | ({description3.TIME_UNIT} if fmi == 3 else set())
    displayed = {(variable.unit, variable.display_unit) for variable in system.variables}
    for name, exponents in UNITS.items():
        if name in used:
            unit = ET.SubElement(definitions, "Unit", name=name)
            ET.SubElement(unit, "BaseUnit", {base: str(power) for base, power in exponents.items()})
            for display, factor in DISPLAY_UNITS.get(name, {}).items():
                if (name, display) in displayed:
                    ET.SubElement(unit, "DisplayUnit", name=display, factor=repr(factor))


def _starts(references: list[Reference], system: TumblingTarget, parameters: NDArray[np.float64]) -> dict[int, str]:
    """The start attributes of inputs, parameters and states, with all digits, by value reference.

    The parameters tell the states; their starts are for importers that evaluate the unit before it is initialised.
    """
    inputs, outputs = (sum(v.size for v in system.of_kind(kind)) for kind in (Kind.INPUT, Kind.OUTPUT))
    states = np.array(system.initial(parameters)).ravel()
    values = np.concatenate([np.zeros(inputs), parameters, np.zeros(outputs), states]).tolist()
    starts = {}
    for place, reference in enumerate(references):
        if reference.variable.kind in (Kind.INPUT, Kind.PARAMETER, Kind.STATE):
            own = values[reference.offset : reference.offset + reference.size]
            starts[place] = " ".join(str(bool(v)).lower() if reference.variable.boolean else repr(v) for v in own)
    return starts
