"""Checks of modelDescription.xml by itself: fmpy's validation, and what that leaves out."""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from math import inf, prod
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ValidationError

from baryscope.fmu.check.finding import Finding, error, listed, warning
from baryscope.fmu.check.names import is_structured, name_findings
from baryscope.fmu.check.units import unit_findings

# Declared capabilities that only a specialised importer can exercise.
UNCHECKED = (
    "needsExecutionTool",
    "canRunAsynchronuously",
    "hasEventMode",
    "providesIntermediateUpdate",
    "mightReturnEarlyFromDoStep",
    "canReturnEarlyAfterIntermediateUpdate",
    "recommendedIntermediateInputSmoothness",
    "providesEvaluateDiscreteStates",
    "providesPerElementDependencies",
)

LEAST_TOLERANCE = 1e-10  # that solvers of importers attain with changing inputs


def description_findings(folder: Path, description: Any) -> Iterator[Finding]:
    """All checks of an unpacked unit that do not run its binary."""
    problems = _fmpy_problems(folder, names=not is_structured(description))
    yield from (error("modelDescription.xml", problem) for problem in problems)
    yield from name_findings(description)
    yield from unit_findings(description)
    yield from _reference_findings(description)
    yield from _start_findings(description)
    yield from _limit_findings(description)
    yield from _nominal_findings(description)
    yield from _derivative_findings(description)
    yield from _dependency_findings(description)
    yield from _flag_findings(description)
    yield from _experiment_findings(description)
    yield from _binary_findings(folder, description)


def _fmpy_problems(folder: Path, *, names: bool) -> list[str]:
    """What fmpy's `validate_fmu` finds in an unpacked unit; names: of variables, too."""
    try:
        fmpy.read_model_description(
            str(folder), validate=True, validate_variable_names=names, validate_model_structure=True
        )
    except ValidationError as found:
        return [str(problem) for problem in found.problems]
    except Exception as problem:  # of a file that it cannot read
        return [str(problem)]
    return []


def read_description(folder: Path) -> Any:
    """fmpy's reading of an unpacked unit's modelDescription.xml.

    Raises:
        Exception: fmpy cannot read it.
    """
    description = fmpy.read_model_description(str(folder), validate=False)
    root = ET.parse(folder / "modelDescription.xml").getroot()  # noqa: S314 - fmpy has read it already
    for name, interface in interfaces(description).items():
        element = root.find(name)
        plural = "providesDirectionalDerivatives"  # FMI 3's spelling, which fmpy 0.3.32 does not know
        if element is not None and plural in element.attrib:
            interface.providesDirectionalDerivative = element.attrib[plural] in ("true", "1")
    return description


def interfaces(description: Any) -> dict[str, Any]:
    """The interfaces that can be checked, with their capabilities, by name."""
    both = {"CoSimulation": description.coSimulation, "ModelExchange": description.modelExchange}
    return {name: interface for name, interface in both.items() if interface is not None}


def size_of(variable: Any) -> int:
    """The number of scalars of a variable, with structural parameters at their starts."""
    if not variable.dimensions:
        return 1
    extents = (
        dimension.start if dimension.start is not None else dimension.variable.start
        for dimension in variable.dimensions
    )
    return prod(int(extent) for extent in extents)


def is_float(variable: Any) -> bool:
    """Whether the variable is a float, so that it has derivatives."""
    return variable.type in ("Real", "Float64")


def is_numeric(variable: Any) -> bool:
    """Whether the variable's values are numbers or Booleans."""
    return variable.type not in ("String", "Binary", "Clock")


def continuous_inputs(description: Any) -> list[Any]:
    """The inputs that may be set at any time of a run; discrete ones may be set at events only."""
    return [v for v in description.modelVariables if v.causality == "input" and v.variability == "continuous"]


def states(description: Any) -> list[Any]:
    """The continuous states, in the order of their vector."""
    return [unknown.variable.derivative for unknown in description.derivatives if unknown.variable.derivative]


def _reference_findings(description: Any) -> Iterator[Finding]:
    """Shared value references. fmpy checks FMI 3 only; in FMI 2 they are aliases, of which at most one may be set."""
    owners: dict[tuple[str, int], Any] = {}
    for variable in description.modelVariables:
        key = (variable.type, int(variable.valueReference))
        owner = owners.setdefault(key, variable)
        if owner is variable or getattr(variable, "alias", None) is not None:
            continue
        both = [owner, variable]
        if all(one.causality in ("parameter", "input") for one in both) or owner.unit != variable.unit:
            yield error(variable.name, f"found value reference {key[1]}, which {owner.name} has already")
        else:
            yield warning(variable.name, f"shares value reference {key[1]} with {owner.name}")


def _start_findings(description: Any) -> Iterator[Finding]:
    """Arrays have as many start values as elements."""
    for variable in description.modelVariables:
        if variable.start is None or variable.type in ("String", "Binary"):
            continue
        texts = str(variable.start).split()
        size = size_of(variable)
        if len(texts) != size and not (len(texts) == 1 and size > 1):
            yield error(variable.name, f"found {len(texts)} start values, expected {size}")
        elif len(texts) != size:
            yield warning(
                variable.name, f"found one start value for {size} elements, which some importers do not repeat"
            )


def limits_of(variable: Any) -> tuple[float, float]:
    """The smallest and the largest value of a variable; infinite where there is no limit."""
    return (
        float(variable.min) if variable.min is not None else -inf,
        float(variable.max) if variable.max is not None else inf,
    )


def _limit_findings(description: Any) -> Iterator[Finding]:
    """Start values lie within the limits of their variables."""
    for variable in description.modelVariables:
        if variable.start is None or variable.type in ("String", "Binary", "Boolean"):
            continue
        smallest, largest = limits_of(variable)
        outside = [text for text in str(variable.start).split() if not smallest <= float(text) <= largest]
        if outside:
            yield error(variable.name, f"found start {listed(outside)}, expected {smallest:g} to {largest:g}")


def _nominal_findings(description: Any) -> Iterator[Finding]:
    """Nominal sizes, by which importers scale their tolerances, are positive."""
    for variable in description.modelVariables:
        wrong = [text for text in str(variable.nominal or "").split() if not 0 < float(text) < inf]
        if wrong:
            yield error(variable.name, f"found nominal {listed(wrong)}, expected a positive number")


def _derivative_findings(description: Any) -> Iterator[Finding]:
    """Every derivative is listed in ModelStructure, has a state of its own, and matches the state in its name."""
    variables = [variable for variable in description.modelVariables if variable.derivative is not None]
    listed_ones = {unknown.variable.name for unknown in description.derivatives}
    shared = Counter(variable.derivative.name for variable in variables)
    for variable in variables:
        state = variable.derivative.name
        if variable.name not in listed_ones and description.modelExchange is not None:
            yield error(variable.name, f"is the derivative of {state}, but not in ModelStructure/Derivatives")
        if shared[state] > 1:
            yield error(variable.name, f"is one of {shared[state]} derivatives of {state}, expected one")
        named = re.fullmatch(r"der\(([^,]+)\)", variable.name)
        if named and description.variableNamingConvention == "structured" and named[1] != state:
            yield error(variable.name, f"found derivative of {state}, expected of {named[1]}")


def _dependency_findings(description: Any) -> Iterator[Finding]:
    """Unknowns depend on inputs and states in a run, and on inputs and exact starts at initialization.

    FMI 3.0 also lists parameters among the knowns of a run; those that are fixed may be listed or not.
    """
    free = ("input", "independent") if description.fmiVersion == "2.0" else ("input", "independent", "parameter")
    running = {state.name for state in states(description)}
    for element, unknowns in (("Outputs", description.outputs), ("Derivatives", description.derivatives)):
        for unknown in unknowns:
            wrong = [
                known.name
                for known in unknown.dependencies or ()
                if known.name not in running
                and known.causality not in free
                and known.variability not in ("discrete", "tunable")
            ]
            if wrong:
                yield warning(
                    unknown.variable.name,
                    f"in ModelStructure/{element} found a dependency on {listed(wrong)}, expected inputs and states",
                )
    for unknown in description.initialUnknowns:
        wrong = [
            known.name
            for known in unknown.dependencies or ()
            if known.causality not in ("input", "independent") and known.initial != "exact"
        ]
        if wrong:
            yield error(
                unknown.variable.name,
                f"in ModelStructure/InitialUnknowns found a dependency on {listed(wrong)}, "
                "expected inputs and variables with exact starts",
            )


def _flag_findings(description: Any) -> Iterator[Finding]:
    for name, interface in interfaces(description).items():
        for flag in UNCHECKED:
            if getattr(interface, flag, False):
                yield warning(f"{name}/{flag}", "is declared, and cannot be checked here")


def _experiment_findings(description: Any) -> Iterator[Finding]:
    """The default experiment ends after it begins, and its tolerance can be that of an importer's solver."""
    experiment = description.defaultExperiment
    if experiment is None:
        return
    if experiment.tolerance is not None and not LEAST_TOLERANCE <= float(experiment.tolerance) < 1:
        expected = f"expected {LEAST_TOLERANCE:g} to 1: importers take it for their own solver's"
        yield warning("DefaultExperiment/tolerance", f"found {experiment.tolerance}, {expected}")
    if experiment.stopTime is None:
        return
    begin, end = float(experiment.startTime or 0.0), float(experiment.stopTime)
    if not end > begin:
        yield error("DefaultExperiment/stopTime", f"found {end:g}, expected a time after that of the start, {begin:g}")


def _binary_findings(folder: Path, description: Any) -> Iterator[Finding]:
    platform = platform_folder(description)
    for name, interface in interfaces(description).items():
        library = folder / "binaries" / platform / f"{interface.modelIdentifier}{fmpy.sharedLibraryExtension}"
        if not library.is_file():
            there = sorted(path.relative_to(folder).as_posix() for path in folder.glob("binaries/*/*"))
            yield error(
                f"{name}/modelIdentifier",
                f"found {listed(there) or 'no binaries'}, expected {library.relative_to(folder).as_posix()}; "
                "the binary could not be checked",
            )


def platform_folder(description: Any) -> str:
    """The folder of the binaries for this machine."""
    return str(fmpy.platform if description.fmiVersion == "2.0" else fmpy.platform_tuple)
