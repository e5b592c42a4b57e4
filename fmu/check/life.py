"""Checks of a unit's life: its version, times and ends of a run, what holds during one, and what a reset leaves."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from baryscope.fmu.check.capabilities import Probe
from baryscope.fmu.check.description import is_float, is_numeric, limits_of
from baryscope.fmu.check.finding import Finding, error, listed, warning
from baryscope.fmu.check.instance import FloatArray, Instance, RefusedError
from baryscope.fmu.check.moving import PERTURBED, duration, move, perturb, slices

STEPS = 5  # of the runs that are looked at and compared
LATER = 3.25  # steps after the default start time: another start that a float holds exactly where the step is one
TOLERANCE = 1e-4  # an importer's, fmpy's own default
ROUNDING = 1e-12  # of times: their sums round differently


def version_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """The library says which FMI it is of, and in FMI 2 that its types are the standard's."""
    with Instance(folder, description, name) as instance:
        version = instance.call("getVersion")
        major, _, _ = str(description.fmiVersion).partition(".")
        if version != "2.0" if instance.fmi2 else not version.startswith(f"{major}."):
            yield error("fmiVersion", f'the {name} binary says "{version}", expected "{description.fmiVersion}"')
        platform = instance.call("getTypesPlatform") if instance.fmi2 else "default"
        if platform != "default":
            yield error("fmi2GetTypesPlatform", f'found "{platform}", expected "default"')


def time_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """A run may start at another time, with a tolerance and an end that its last step reaches; the unit keeps time."""
    h = duration(description)
    clocks = [v for v in description.modelVariables if v.causality == "independent" and is_float(v)]
    with Instance(folder, description, name) as instance:
        start = instance.default_start + LATER * h
        stop = start + STEPS * h
        try:
            instance.initialise(start, stop, TOLERANCE)
        except RefusedError as refusal:
            yield error(name, f"a run from {start:.9g} s with a stop time and a tolerance: {refusal}")
            return
        wrong = list(_clock_findings(instance, clocks, 0.0))
        yield from wrong
        instance.run()
        between = _internal_step(description) if instance.co_simulation else 0.0
        for _ in range(STEPS):
            if wrong:
                return
            if instance.co_simulation:
                wrong += _answer_findings(instance, name, instance.step(min(h, stop - instance.time)), between)
            else:
                instance.set_time(instance.time + h)
            wrong += _clock_findings(instance, clocks, between)
            yield from wrong


def _internal_step(description: Any) -> float:
    """The fixed internal step, if there is one: a unit with it may be behind the importer's time by up to one."""
    return float(description.coSimulation.fixedInternalStepSize or 0.0)


def _is_off(instance: Instance, time: float, between: float) -> bool:
    """Whether a time is not the importer's, but for rounding and internal steps."""
    return not abs(time - instance.time) <= (1.0 + ROUNDING) * between + ROUNDING * max(1.0, abs(instance.time))


def _clock_findings(instance: Instance, clocks: list[Any], between: float) -> Iterator[Finding]:
    """The independent variable has the importer's time."""
    for clock in clocks:
        [found] = instance.get([clock])
        if not _is_off(instance, found, between):
            continue
        lags = instance.fmi2 and instance.co_simulation and found < instance.time  # FMI 2 declares no internal steps
        yield (warning if lags else error)(
            clock.name, f"found {found:.17g} in {instance.interface}, expected {instance.time:.17g}, the run's time"
        )


def _answer_findings(
    instance: Instance, name: str, found: tuple[bool, bool, bool, float] | None, between: float
) -> Iterator[Finding]:
    """FMI 3's answers to a step by an importer that allows neither events nor early returns."""
    if found is None:
        return
    event, terminate, early, last = found
    if event:
        yield error(f"{name}/doStep", "found eventHandlingNeeded, expected none as eventModeUsed is false")
    if early:
        yield error(f"{name}/doStep", "found earlyReturn, expected none as earlyReturnAllowed is false")
    if terminate:
        yield warning(f"{name}/doStep", f"asks to end the run at {instance.time:.9g}, before its stop time")
    if _is_off(instance, last, between):
        yield error(f"{name}/doStep", f"found lastSuccessfulTime {last:.17g}, expected {instance.time:.17g}")


def run_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """In a run inputs and parameters keep their values, and all others are finite and within their limits."""
    numeric = [v for v in description.modelVariables if is_numeric(v)]
    told = [v for v in numeric if _is_told(v)]
    rest = [v for v in numeric if not _is_told(v)]
    free = [v for v in told if v.causality == "input" and is_float(v) and limits_of(v) == (-np.inf, np.inf)]
    with Instance(folder, description, name) as instance:
        instance.initialise()
        perturb(instance, free, rest, np.random.default_rng(0), 1)
        instance.run()
        expected = instance.get(told)
        for _ in range(STEPS):
            move(instance, 1)
            found = instance.get(told)
            for variable, place in zip(told, slices(told), strict=True):
                if not np.array_equal(found[place], expected[place], equal_nan=True):
                    what = f"{variable.variability} {variable.causality}"
                    yield error(variable.name, f"is a {what}, but changed in a run of {name} that did not set it")
            if not np.array_equal(found, expected, equal_nan=True):
                return
            wrong = list(_range_findings(rest, instance.get(rest)))
            yield from wrong
            if wrong:
                return


def _is_told(variable: Any) -> bool:
    """Whether a variable has the value that it was given or started with, for as long as nobody sets one."""
    return variable.causality in ("input", "parameter", "structuralParameter") or variable.variability in (
        "constant",
        "fixed",
    )


def _range_findings(variables: list[Any], values: FloatArray) -> Iterator[Finding]:
    """Values in a run that are not finite or beyond their declared limits."""
    for variable, place in zip(variables, slices(variables), strict=True):
        found = values[place]
        smallest, largest = limits_of(variable)
        if not np.all(np.isfinite(found)):
            yield error(variable.name, "is not finite in a run")
        elif found.size and (found.min() < smallest or found.max() > largest):
            worst = found.min() if found.min() < smallest else found.max()
            yield error(variable.name, f"found {worst:.9g} in a run, expected {smallest:g} to {largest:g}")


def reset_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """A reset unit is as new: after a run with other inputs and parameters it has its starts, and runs as at first."""
    numeric = [v for v in description.modelVariables if is_numeric(v)]
    outputs = [v for v in numeric if v.causality == "output"]
    knowns = [v for v in numeric if v.causality in ("input", "parameter") and v.type in PERTURBED]
    with Instance(folder, description, name) as instance:
        instance.initialise()
        starts = instance.get(numeric)
        instance.run()
        expected = move(instance, STEPS)
        instance.restart()
        perturb(instance, knowns, outputs, np.random.default_rng(0), 1)
        instance.run()
        move(instance, 1)
        instance.call("terminate")
        try:
            instance.get(outputs)
        except RefusedError as refusal:
            yield error(name, f"outputs cannot be read after the end of a run: {refusal}")
        instance.restart()
        found = instance.get(numeric)
        wrong = [
            variable.name
            for variable, place in zip(numeric, slices(numeric), strict=True)
            if not np.array_equal(found[place], starts[place], equal_nan=True)
        ]
        if wrong:
            yield error(name, f"after a reset {listed(wrong)} differed from those of a new instance")
        instance.run()
        if not wrong and not np.array_equal(move(instance, STEPS), expected, equal_nan=True):
            yield error(name, "after a reset the run differed from that of a new instance")


LIFE: dict[str, Probe] = {
    "version": version_findings,
    "times": time_findings,
    "a run": run_findings,
    "reset": reset_findings,
}
