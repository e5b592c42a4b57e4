"""The chain of our units around a scenario: target, rig, estimator, controller."""

from collections.abc import Mapping
from dataclasses import dataclass

from baryscope.fmu.units import Blueprint, blueprint_of
from baryscope.models.scenario import Scenario
from baryscope.models.variables import Kind, Variable

ELEMENTS = ("target", "rig", "estimator", "controller")
"""The elements' names, which are those of `--unit`, in the order in which they are stepped."""

_LINKS = (
    ("target", "features", "rig", "features"),
    ("target", "normals", "rig", "normals"),
    ("target", "orbit.position", "rig", "orbit.position"),
    ("rig", "points", "estimator", "points"),
    ("rig", "covariances", "estimator", "covariances"),
    ("rig", "seen", "estimator", "seen"),
    ("rig", "camera.measuredAttitude", "estimator", "camera.attitude"),
    ("rig", "sample.time", "estimator", "sample.time"),
    ("rig", "sample.number", "estimator", "sample.number"),
    ("estimator", "target.position", "controller", "target.position"),
    ("estimator", "target.velocity", "controller", "target.velocity"),
    ("estimator", "target.attitude", "controller", "target.attitude"),
    ("estimator", "navigation.valid", "controller", "navigation.valid"),
    ("controller", "camera.attitude", "rig", "camera.attitude"),
    ("controller", "command.acceleration", "target", "chaser.acceleration"),
    ("controller", "command.acceleration", "estimator", "chaser.acceleration"),
)


@dataclass(frozen=True)
class Connection:
    """An output that becomes an input in the next step; scalars are connected in their order.

    Attributes:
        start: element and output.
        end: element and input, of the same shape.
    """

    start: tuple[str, Variable]
    end: tuple[str, Variable]


@dataclass(frozen=True, eq=False)
class Chain:
    """The units of a system by their elements' names, and the connections."""

    units: Mapping[str, Blueprint]
    connections: tuple[Connection, ...]

    def connected(self, element: str) -> list[Variable]:
        """The variables of an element that are connected, inputs first, each once."""
        ends = [one.end[1] for one in self.connections if one.end[0] == element]
        starts = [one.start[1] for one in self.connections if one.start[0] == element]
        return list(dict.fromkeys([*ends, *starts]))


def chain_of(scenario: Scenario) -> Chain:
    """The chain of a scenario. The target's orbit is connected only where its unit has it, with forces.

    Raises:
        InputError: a unit cannot be made of the scenario.
    """
    units = {name: blueprint_of(name, scenario) for name in ELEMENTS}
    found = []
    for first, output, second, taken in _LINKS:
        start = _variable(units[first], output, Kind.OUTPUT)
        end = _variable(units[second], taken, Kind.INPUT)
        if start is not None and end is not None:
            found.append(Connection((first, start), (second, end)))
    return Chain(units, tuple(found))


def _variable(unit: Blueprint, name: str, kind: Kind) -> Variable | None:
    return next((variable for variable in unit.of_kind(kind) if variable.name == name), None)
