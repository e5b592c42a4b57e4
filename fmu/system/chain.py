"""The chain of our units around a scenario: target, rig, estimator, controller."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from baryscope.fmu.system.guest import Guest
from baryscope.fmu.units import Blueprint, blueprint_of
from baryscope.models.scenario import Scenario
from baryscope.models.variables import Kind, Variable

ELEMENTS = {"plant": "target", "rig": "rig", "estimator": "estimator", "controller": "controller"}
"""The elements' names and their units, as `--unit` names them, in the order in which they are stepped.

None is what a variable of its unit begins with: OMSimulator takes `target.inertia` of an element `target` for its
`inertia`.
"""

_LINKS = (
    ("plant", "features", "rig", "features"),
    ("plant", "normals", "rig", "normals"),
    ("plant", "orbit.position", "rig", "orbit.position"),
    ("rig", "points", "estimator", "points"),
    ("rig", "covariances", "estimator", "covariances"),
    ("rig", "seen", "estimator", "seen"),
    ("rig", "camera.measuredAttitude", "estimator", "camera.attitude"),
    ("rig", "sample.time", "estimator", "sample.time"),
    ("rig", "sample.number", "estimator", "sample.number"),
    ("estimator", "target.position", "controller", "target.position"),
    ("estimator", "target.velocity", "controller", "target.velocity"),
    ("estimator", "target.positionCovariance", "controller", "target.positionCovariance"),
    ("estimator", "target.velocityCovariance", "controller", "target.velocityCovariance"),
    ("estimator", "target.attitude", "controller", "target.attitude"),
    ("estimator", "target.angularRate", "controller", "target.angularRate"),
    ("estimator", "target.inertia", "controller", "target.inertia"),
    ("estimator", "body.features", "controller", "grapple.point"),
    ("estimator", "navigation.valid", "controller", "navigation.valid"),
    ("estimator", "sight.position", "controller", "sight.position"),
    ("estimator", "thrust.error", "controller", "thrust.error"),
    ("controller", "camera.attitude", "rig", "camera.attitude"),
    ("controller", "command.acceleration", "plant", "chaser.acceleration"),
    ("controller", "command.acceleration", "estimator", "chaser.acceleration"),
)


@dataclass(frozen=True)
class Connection:
    """An output that becomes an input in the next step; scalars are connected in their order, as many as the input has.

    Attributes:
        start: element and output.
        end: element and input.
    """

    start: tuple[str, Variable]
    end: tuple[str, Variable]

    @property
    def scalars(self) -> list[tuple[str, str]]:
        """The names of its scalars: of the output and of the input."""
        output, taken = self.start[1].scalar_names, self.end[1].scalar_names
        return list(zip(output[: len(taken)], taken, strict=True))


@dataclass(frozen=True, eq=False)
class Chain:
    """The units of a system by their elements' names, and the connections; guests: units in the places of some."""

    units: Mapping[str, Blueprint]
    connections: tuple[Connection, ...]
    guests: Mapping[str, Guest] = field(default_factory=dict)

    def connected(self, element: str) -> dict[str, Variable]:
        """The scalars of an element that are connected, and the variables that they are of; inputs first."""
        ends = {name: one.end[1] for one in self.connections if one.end[0] == element for _, name in one.scalars}
        starts = {name: one.start[1] for one in self.connections if one.start[0] == element for name, _ in one.scalars}
        return ends | starts

    def parameters(self, element: str) -> list[Variable]:
        """The parameters of an element's unit that are bound: all of ours, those that a guest has by the same names."""
        own, guest = self.units[element].of_kind(Kind.PARAMETER), self.guests.get(element)
        return own if guest is None else [variable for variable in own if guest.has(variable)]


def chain_of(scenario: Scenario, guests: Mapping[str, Guest] | None = None) -> Chain:
    """The chain of a scenario. The target's orbit is connected only where its unit has it, with forces.

    The grapple point is the first feature, where the estimator's map has it. A guest must have all outputs that are
    connected; of the inputs it is given those that it has.

    Raises:
        InputError: a unit cannot be made of the scenario, or a guest does not fit.
    """
    units, guests = {name: blueprint_of(unit, scenario) for name, unit in ELEMENTS.items()}, guests or {}
    found = []
    for first, output, second, taken in _LINKS:
        start = _variable(units[first], output, Kind.OUTPUT)
        end = _variable(units[second], taken, Kind.INPUT)
        if start is not None and end is not None:
            found.append(Connection((first, start), (second, end)))
    for name, guest in guests.items():
        guest.require({one.start[1].name: one.start[1] for one in found if one.start[0] == name}.values())
        found = [one for one in found if one.end[0] != name or guest.has(one.end[1])]
    return Chain(units, tuple(found), guests)


def _variable(unit: Blueprint, name: str, kind: Kind) -> Variable | None:
    return next((variable for variable in unit.of_kind(kind) if variable.name == name), None)
