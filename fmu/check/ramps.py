"""Derivatives of inputs (FMI 2): whether a unit that takes them follows them over a communication step."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from baryscope.fmu.check.description import continuous_inputs, is_float
from baryscope.fmu.check.finding import Finding, error
from baryscope.fmu.check.instance import FloatArray, Instance, RefusedError
from baryscope.fmu.check.moving import duration

PARTS = 8  # short steps with held inputs, which a ramp is compared with: their error is 1/64 of its effect
VISIBLE = 1e-9  # effects on outputs below this share of them say nothing


def ramp_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """Outputs after a step with the derivative of an input are those of short steps in which the input climbs."""
    flags = description.coSimulation
    if name != "CoSimulation" or not flags.canInterpolateInputs or description.fmiVersion != "2.0":
        return
    comparable = flags.canHandleVariableCommunicationStepSize and not flags.fixedInternalStepSize
    with Instance(folder, description, name) as instance:
        instance.initialise()
        for known in filter(is_float, continuous_inputs(description)):
            try:
                ramp = _Ramp(instance, known)
                followed = ramp.outputs(ramp.follow)
            except RefusedError as refusal:
                yield error(f"{name}/canInterpolateInputs", f"is declared, but {refusal}")
                return
            if comparable:
                yield from ramp.compared(followed)


class _Ramp:
    """One input that climbs by its own size, or by 1, over a communication step at the start."""

    def __init__(self, instance: Instance, known: Any) -> None:
        self.instance, self.known = instance, known
        self.h = duration(instance.description)
        self.start = float(instance.get([known])[0])
        self.rate = max(1.0, abs(self.start)) / self.h
        variables = instance.description.modelVariables
        self.unknowns = [v for v in variables if v.causality == "output" and is_float(v)]

    def outputs(self, move: Callable[[], None]) -> FloatArray:
        """The outputs after a run from its beginning."""
        self.instance.run()
        move()
        found = self.instance.get(self.unknowns)
        self.instance.restart()
        return found

    def follow(self) -> None:
        """One step with the derivative."""
        self.instance.set([self.known], [self.start])
        self.instance.call("setRealInputDerivatives", [self.known.valueReference], [1], [self.rate])
        self.instance.step(self.h)

    def hold(self) -> None:
        """One step with the input held."""
        self.instance.set([self.known], [self.start])
        self.instance.step(self.h)

    def climb(self) -> None:
        """Short steps with the input held at the middle of each."""
        part = self.h / PARTS
        for k in range(PARTS):
            self.instance.set([self.known], [self.start + self.rate * part * (k + 0.5)])
            self.instance.step(part)

    def compared(self, followed: FloatArray) -> Iterator[Finding]:
        """An error if, of most outputs, the distance to those of short steps is above half of the effect.

        Not all: outputs that the input acts on at once may be of the value that was set.
        """
        held, expected = self.outputs(self.hold), self.outputs(self.climb)
        effect = np.abs(expected - held)
        seen = effect > VISIBLE * (np.abs(expected) + np.abs(held))
        if not seen.any() or np.median(np.abs(followed - expected)[seen] / effect[seen]) < 0.5:
            return
        place = int(np.argmax(np.where(seen, effect, 0.0)))
        yield error(
            self.known.name,
            f"with derivative {self.rate:g} found {self.unknowns[place].name} {followed[place]:.9g} after a step, "
            f"expected {expected[place]:.9g} as by short steps (canInterpolateInputs is declared)",
        )
