"""What tells one unit from another: all that the generator needs to know of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.models.checks import Check
from baryscope.models.scenario import Scenario
from baryscope.models.variables import Kind, Variable

FloatArray = NDArray[np.float64]
Dependencies = Mapping[int, Sequence[int]]
"""For each unknown, the places of the knowns that it depends on, in increasing order."""


@dataclass(frozen=True)
class Section:
    """A part of a unit's page: a heading, a sentence, a list, a table with or without a head.

    Attributes:
        last: stands after the table of variables.
    """

    title: str
    text: str = ""
    items: tuple[str, ...] = ()
    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    last: bool = False


@dataclass(frozen=True, eq=False)
class Core:
    """A unit's half of the C code; the other half is FMI's shell, which all units share.

    Attributes:
        functions: CasADi's, written to model.c; their names are those of the C functions.
        checks: conditions on parameters and states by the name of their C array; CHECKS, on the parameters, is needed.
        sizes: constants of tables.h besides those that all units have.
        generated: further generated C files, texts by name.
        headers: files that declare the struct `Unit`, in order.
        files: files that define the functions of unit.h, in order.
    """

    functions: tuple[ca.Function, ...]
    checks: Mapping[str, tuple[Check, ...]]
    headers: tuple[str, ...]
    files: tuple[str, ...]
    sizes: Mapping[str, int] = field(default_factory=dict)
    generated: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Setting:
    """What every unit of a scenario has of it.

    Attributes:
        labels: of the features, the rows of matrices.
        facts: rows of the table at the head of the unit's page.
        stop_time, step_size: of the default experiment, s.
    """

    labels: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    stop_time: float
    step_size: float


@dataclass(frozen=True, eq=False)
class Blueprint:
    """A unit, as one scenario needs it.

    Attributes:
        name: of the model and its library; prefix of its C functions.
        summary: what it is, in one line.
        variables: the table, in the order of the flat vectors.
        starts: start values of inputs, parameters and states by name, in the variables' shapes.
        core: its C code.
        setting: what it has of its scenario.
        sections: of its page, besides those that all units have.
        use: sentences on how it is used.
        dependencies: FMI's version → dependencies of scalars, by their places in the table, in a run and at the start;
            None for a sampled unit, whose outputs are of steps done, so that nothing that is set changes them at once.
        tolerance: of the default experiment; None if the unit integrates nothing.
    """

    name: str
    summary: str
    variables: tuple[Variable, ...]
    starts: Mapping[str, FloatArray]
    core: Core
    setting: Setting
    sections: tuple[Section, ...]
    use: tuple[str, ...]
    dependencies: Callable[[FmiVersion], tuple[Dependencies, Dependencies]] | None = None
    tolerance: float | None = None

    def of_kind(self, kind: Kind) -> list[Variable]:
        """The variables of one kind, in order."""
        return [variable for variable in self.variables if variable.kind == kind]

    @property
    def is_sampled(self) -> bool:
        """Whether it has no continuous states: outputs change in communication steps only, and have no derivatives."""
        return not self.of_kind(Kind.STATE)


@dataclass(frozen=True)
class UnitKind:
    """A kind of unit that `baryscope build --unit` makes.

    Attributes:
        name: of the model.
        blueprint: scenario → its blueprint.
        table: names and shapes in a modelDescription.xml → the table of variables of the unit that they are of.
    """

    name: str
    blueprint: Callable[[Scenario], Blueprint]
    table: Callable[[Mapping[str, tuple[int, ...]]], tuple[Variable, ...]]


def setting_of(scenario: Scenario) -> Setting:
    """What every unit of a scenario has of it; `?` stands for characters of labels that no page shows."""
    return Setting(
        labels=tuple("".join(c if c.isprintable() else "?" for c in label) for label in scenario.features.labels),
        facts=(("scenario", f"{scenario.name}: {scenario.description}" if scenario.description else scenario.name),),
        stop_time=scenario.duration,
        step_size=scenario.run.sample_time,
    )


def starts_of(variables: Sequence[Variable], given: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
    """Start values of a table's inputs and parameters in their shapes: as given, else zeros."""
    set_ones = [variable for variable in variables if variable.kind in (Kind.INPUT, Kind.PARAMETER)]
    return {v.name: np.asarray(given.get(v.name, np.zeros(v.shape)), dtype=np.float64) for v in set_ones}


def feature_count(described: Mapping[str, tuple[int, ...]], name: str) -> int:
    """The number of rows of a matrix (count, 3) among described names and shapes: scalars, or one array."""
    if name in described:
        return max(3, described[name][0]) if described[name] else 3
    return max(3, round(sum(other.startswith(f"{name}[") for other in described) / 3))
