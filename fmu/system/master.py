"""A master for systems of FMI 2.0 units: all step at once, then outputs become inputs (Jacobi), by fmpy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.fmu.layout.measures import Measure
from baryscope.fmu.runtime.instance import UnitError

FloatArray = NDArray[np.float64]


@dataclass(eq=False)
class Unit:
    """An instance in a system.

    Attributes:
        name: of its element.
        model: name of its model.
        references: value references of its scalars by name.
        booleans: the names of those that are Booleans.
        integers: the names of those that are Integers or of an enumeration.
        step_size: of its default experiment, s; None if it has none.
        fmu: the instance, by fmpy.
        messages: errors that it has logged.
        parameters: bound values by name.
        measures: units of measurement by name, of scalars that have one.
        descriptions: by name, of scalars that have one.
    """

    name: str
    model: str
    references: Mapping[str, int]
    booleans: frozenset[str]
    integers: frozenset[str]
    step_size: float | None
    fmu: Any
    messages: list[str]
    parameters: Mapping[str, float] = field(default_factory=dict)
    measures: Mapping[str, Measure] = field(default_factory=dict)
    descriptions: Mapping[str, str] = field(default_factory=dict)
    _scalars: dict[str, list[str]] = field(default_factory=dict)

    def get(self, names: Sequence[str]) -> FloatArray:
        """Scalars of one type by their names."""
        integer = bool(names) and names[0] in self.integers
        other = self.fmu.getInteger if integer else self.fmu.getReal
        read = self.fmu.getBoolean if self._are_booleans(names) else other
        return np.asarray(self._called(read, [self.references[name] for name in names]), dtype=np.float64)

    def set(self, names: Sequence[str], values: FloatArray) -> None:
        """Set scalars of one type."""
        places = [self.references[name] for name in names]
        if self._are_booleans(names):
            self._called(self.fmu.setBoolean, places, [bool(value) for value in values])
        else:
            self._called(self.fmu.setReal, places, values.tolist())

    def vector(self, name: str) -> FloatArray:
        """A variable with its elements in order."""
        return self.get(self.scalars(name))

    def scalars(self, name: str) -> list[str]:
        """The names of a variable's elements."""
        if name not in self._scalars:
            self._scalars[name] = [known for known in self.references if known == name or known.startswith(f"{name}[")]
        return self._scalars[name]

    def start(self) -> None:
        """Set the bound parameters and initialise."""
        reals = [name for name in self.parameters if name not in self.booleans]
        switches = [name for name in self.parameters if name in self.booleans]
        for names in (reals, switches):
            if names:
                self.set(names, np.array([self.parameters[name] for name in names]))
        self._called(self.fmu.setupExperiment, startTime=0.0)
        self._called(self.fmu.enterInitializationMode)
        self._called(self.fmu.exitInitializationMode)

    def step(self, time: float, length: float) -> None:
        """Step from a time, s."""
        self._called(self.fmu.doStep, currentCommunicationPoint=time, communicationStepSize=length)

    def _are_booleans(self, names: Sequence[str]) -> bool:
        return bool(names) and names[0] in self.booleans

    def _called(self, function: Any, *arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except Exception as error:  # fmpy raises bare Exceptions
            raise UnitError(f"{self.name}: {'; '.join(self.messages) or error}") from error


@dataclass(frozen=True)
class Bundle:
    """Scalars of one type that go from one unit to another."""

    start: str
    outputs: tuple[str, ...]
    end: str
    inputs: tuple[str, ...]


class Master:
    """Steps a system.

    Attributes:
        units: by their elements' names.
        time: s.
        step_size: the shortest of the units' own, s.
        stop_time: of the default experiment, s; None if there is none.
    """

    def __init__(self, units: Mapping[str, Unit], bundles: Sequence[Bundle], stop_time: float | None):
        self.units = units
        self.stop_time = stop_time
        self.step_size = min((unit.step_size for unit in units.values() if unit.step_size), default=1.0)
        self.time = 0.0
        self._steps = 0
        self._bundles = bundles
        for unit in units.values():
            unit.start()
        self._exchange()

    def of_model(self, model: str) -> Unit | None:
        """The first unit of a model."""
        return next((unit for unit in self.units.values() if unit.model == model), None)

    def source_of(self, unit: Unit, scalar: str) -> tuple[str, str] | None:
        """The element and the output that an input of a unit is connected to; None if it is not."""
        ends = (
            (one, one.inputs.index(scalar)) for one in self._bundles if one.end == unit.name and scalar in one.inputs
        )
        return next(((one.start, one.outputs[place]) for one, place in ends), None)

    def step(self) -> None:
        """Step all units, then hand their outputs on.

        Raises:
            UnitError: a unit refuses the step or a value.
        """
        for unit in self.units.values():
            unit.step(self.time, self.step_size)
        self._steps += 1
        self.time = self._steps * self.step_size
        self._exchange()

    def _exchange(self) -> None:
        values = [self.units[one.start].get(one.outputs) for one in self._bundles]
        for one, value in zip(self._bundles, values, strict=True):
            self.units[one.end].set(one.inputs, value)
