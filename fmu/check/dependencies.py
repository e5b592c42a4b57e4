"""Checks of ModelStructure against the binary: what depends on what, and whether derivatives are derivatives.

Dependencies are looked for at a few points near the start values, by directional derivatives where they are declared,
by differences elsewhere. An influence that is not declared is an error; one that is declared and was not seen by exact
derivatives, a warning.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from baryscope.fmu.check.description import continuous_inputs, interfaces, is_float, size_of, states
from baryscope.fmu.check.finding import Finding, error, listed, warning
from baryscope.fmu.check.instance import FloatArray, Instance, RefusedError
from baryscope.fmu.check.moving import (
    PERTURBED,
    Setter,
    change,
    movable,
    perturb,
    scatter,
    setter_in_a_run,
    slices,
    total,
)

POINTS = 3
DIFFERENCE = 1e-6  # of a variable's size
NOISE = 1e-12  # of the largest influence on an unknown; smaller ones are rounding


@dataclass
class Influences:
    """The largest observed influence of each known on each unknown, in units of the known's size."""

    element: str
    unknowns: list[Any]
    knowns: list[Any]
    largest: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.largest = np.zeros((total(self.unknowns), total(self.knowns)))

    def add(self, columns: FloatArray) -> None:
        """Add the influences at one more point."""
        self.largest = np.maximum(self.largest, np.abs(np.nan_to_num(columns)))

    def findings(self, declared: dict[str, set[str] | None], exact: bool) -> Iterator[Finding]:
        """Differences between observed and declared dependencies; None declares a dependency on everything."""
        strongest = self.largest.max(axis=1, initial=0.0)
        threshold = strongest * (NOISE if exact else 1e-6)
        seen = self.largest > np.maximum(threshold, 1e-300)[:, None]
        rows, columns = slices(self.unknowns), slices(self.knowns)
        for unknown, row in zip(self.unknowns, rows, strict=True):
            names = declared.get(unknown.name)
            if names is None:
                continue
            found = {known.name for known, column in zip(self.knowns, columns, strict=True) if seen[row, column].any()}
            found.discard(unknown.name)  # an output that is a state
            weak = {
                known.name
                for known, column in zip(self.knowns, columns, strict=True)
                if self.largest[row, column].any()
            }
            where = f"in ModelStructure/{self.element}"
            missing, idle = sorted(found - names), sorted(names - weak)
            known_names = {known.name for known in self.knowns}
            if missing:
                yield error(unknown.name, f"depends on {listed(missing)}, expected {where} to say so")
            idle = [name for name in idle if name in known_names]
            if idle and exact:  # finite differences miss weak influences
                yield warning(unknown.name, f"{where} depends on {listed(idle)}, but no influence was observed")


def start_dependency_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """InitialUnknowns, and directional derivatives in Initialization Mode."""
    unknowns = [u.variable for u in description.initialUnknowns if is_float(u.variable)]
    exactly = [v for v in description.modelVariables if v.initial == "exact" and v.variability != "constant"]
    knowns = [v for v in exactly if v.type in PERTURBED and v.causality != "structuralParameter"]
    if not unknowns or not knowns:
        return
    exact = _offers_derivatives(description, name)
    influences = Influences("InitialUnknowns", unknowns, knowns)
    floats = [known for known in knowns if is_float(known)]
    rng = np.random.default_rng(0)
    with Instance(folder, description, name) as instance:
        instance.initialise()
        for point in range(POINTS):
            if point:
                instance.restart()
                perturb(instance, knowns, unknowns, rng, point)
            if _checks_structure(description, name):
                influences.add(_influences(instance, unknowns, knowns, instance.set, floats if exact else []))
            if exact and floats:
                found = list(
                    _derivative_findings(instance, unknowns, floats, instance.set, rng, f"{name} at the start")
                )
                yield from found
                exact = not found  # report once, then use differences
    if _checks_structure(description, name):
        yield from influences.findings(_declared(description.initialUnknowns), exact)


def run_dependency_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """Outputs and Derivatives, and directional derivatives in a run."""
    groups = [
        (element, [u for u in unknowns if is_float(u.variable)])
        for element, unknowns in (("Outputs", description.outputs), ("Derivatives", description.derivatives))
    ]
    unknowns = [unknown.variable for _, group in groups for unknown in group]
    inputs = [v for v in continuous_inputs(description) if is_float(v)]
    state = [] if name == "CoSimulation" and not _offers_derivatives(description, name) else states(description)
    tunable = [] if description.fmiVersion == "2.0" else _tunable(description)  # FMI 2 does not count them
    knowns = [*inputs, *tunable, *state]
    if not unknowns or not knowns:
        return
    exact = _offers_derivatives(description, name)
    floats = [known for known in knowns if is_float(known)]
    influences = [Influences(element, [u.variable for u in group], knowns) for element, group in groups]
    parameters = [v for v in description.modelVariables if v.causality == "parameter" and v.type in PERTURBED]
    rng = np.random.default_rng(1)
    with Instance(folder, description, name) as instance:
        for point in range(POINTS):
            instance.initialise() if point == 0 else instance.restart()
            perturb(instance, parameters, unknowns, rng, point)
            instance.run()
            scatter(instance, inputs, rng)
            setter = setter_in_a_run(instance)
            if exact and point == 0:
                refused = dict(_refused(instance, unknowns, [known for known in tunable if is_float(known)]))
                yield from refused.values()
                floats = [known for known in floats if known.name not in refused]
            if _checks_structure(description, name):
                columns = _influences(instance, unknowns, knowns, setter, floats if exact else [])
                for influence, part in zip(influences, np.split(columns, [len(influences[0].largest)]), strict=True):
                    influence.add(part)
            moved = [known for known in floats if name == "ModelExchange" or known not in state]
            if exact and moved:
                found = list(_derivative_findings(instance, unknowns, moved, setter, rng, f"{name} in a run"))
                yield from found
                exact = not found
    for influence, (_, group) in zip(influences, groups, strict=True):
        if _checks_structure(description, name):
            yield from influence.findings(_declared(group), exact)


# ---- influences and derivatives ----


def _influences(
    instance: Instance, unknowns: list[Any], knowns: list[Any], setter: Setter, exactly: list[Any]
) -> FloatArray:
    """The change of all unknowns with every scalar of the knowns, per size of the known.

    By directional derivatives for the knowns in `exactly`, by differences for others.
    """
    columns = []
    for known in knowns:
        values = instance.get([known])
        size = np.maximum(np.abs(values), 1.0)
        for unit in np.eye(values.size):
            if known in exactly:
                columns.append(instance.derivative(unknowns, [known], unit * size))
            else:
                moved = values + unit * (1e-5 * size if is_float(known) else 1.0 - 2.0 * values)
                columns.append(change(instance, unknowns, [known], setter, values, moved))
    return np.array(columns).T


def _refused(instance: Instance, unknowns: list[Any], tunable: list[Any]) -> Iterator[tuple[str, Finding]]:
    """The tunable parameters by which the unit has no directional derivatives in a run, with the finding."""
    for known in tunable:
        try:
            instance.derivative(unknowns, [known], np.ones(size_of(known)))
        except RefusedError as refusal:
            where = f"{instance.interface} in a run/providesDirectionalDerivative"
            yield known.name, error(where, f"by the tunable parameter {known.name} {refusal}")


def _derivative_findings(
    instance: Instance, unknowns: list[Any], knowns: list[Any], setter: Setter, rng: np.random.Generator, where: str
) -> Iterator[Finding]:
    """A directional derivative against central differences, and where declared the adjoint derivative against it."""
    unknowns = [unknown for unknown in unknowns if unknown not in knowns]
    knowns = movable(instance, unknowns, knowns, setter, DIFFERENCE)
    if not knowns:
        return
    values = instance.get(knowns)
    seed = rng.uniform(0.3, 1.0, values.size) * np.maximum(np.abs(values), 1.0)
    found = instance.derivative(unknowns, knowns, seed)
    flags = interfaces(instance.description)[instance.interface]
    if flags.providesAdjointDerivatives:
        weights = rng.uniform(0.3, 1.0, found.size)
        forward, backward = float(weights @ found), float(instance.adjoint(unknowns, knowns, weights) @ seed)
        if abs(forward - backward) > 1e-9 * float(np.abs(weights) @ np.abs(found)):
            yield error(f"{where}/providesAdjointDerivatives", f"found {backward:.12g}, expected {forward:.12g}")
    ends = []
    try:
        for sign in (1.0, -1.0):
            setter(knowns, values + sign * DIFFERENCE * seed)
            ends.append(instance.get(unknowns))
    except RefusedError:
        return  # too near to the edge of what the unit accepts
    finally:
        setter(knowns, values)
    differences = (ends[0] - ends[1]) / (2 * DIFFERENCE)
    noise = 1e-3 * np.maximum(np.abs(differences), np.abs(found)) + 1e-9 * np.abs(ends[0]) + 1e-9
    names = [unknown.name for unknown in unknowns for _ in range(size_of(unknown))]
    wrong = np.flatnonzero(np.abs(differences - found) > noise)
    if wrong.size:
        first, others = int(wrong[0]), f" and of {wrong.size - 1} more" if wrong.size > 1 else ""
        yield error(
            f"{where}/providesDirectionalDerivative",
            f"of {names[first]} found {found[first]:.9g}, expected {differences[first]:.9g} by differences{others}",
        )


def _tunable(description: Any) -> list[Any]:
    """The tunable parameters, which FMI 3.0 counts among the knowns of a run."""
    return [
        v
        for v in description.modelVariables
        if v.causality == "parameter" and v.variability == "tunable" and v.type in PERTURBED
    ]


def _offers_derivatives(description: Any, name: str) -> bool:
    return bool(interfaces(description)[name].providesDirectionalDerivative)


def _checks_structure(description: Any, name: str) -> bool:
    """Whether to check ModelStructure by this interface: by Model Exchange, which can set states, if there is one."""
    return name == list(interfaces(description))[-1]


def _declared(unknowns: Sequence[Any]) -> dict[str, set[str] | None]:
    return {
        unknown.variable.name: None if unknown.dependencies is None else {known.name for known in unknown.dependencies}
        for unknown in unknowns
    }
