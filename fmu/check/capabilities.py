"""Checks of declarations in modelDescription.xml against the binary: token, start values, capabilities."""

import ctypes
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from baryscope.fmu.check.description import continuous_inputs, interfaces, is_float, is_numeric, size_of, states
from baryscope.fmu.check.finding import Finding, error, warning
from baryscope.fmu.check.instance import FloatArray, Instance, RefusedError
from baryscope.fmu.check.moving import duration, move
from baryscope.models.words import counted

Probe = Callable[[Path, Any, str], Iterator[Finding]]


def token_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """The binary accepts the token of the XML, and no other."""
    Instance(folder, description, name).close()
    try:
        Instance(folder, description, name, token="{no unit has this token}").close()  # noqa: S106 - no password
    except RefusedError:
        return
    yield warning("token", f"the {name} binary accepts any token, so it may belong to another build than the XML")


def start_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """Every variable can be read, and start values in the XML are exactly those of the binary."""
    with Instance(folder, description, name) as instance:
        instance.initialise()
        for variable in description.modelVariables:
            if not is_numeric(variable):
                continue
            try:
                found = instance.get([variable])
            except RefusedError as refusal:
                yield error(variable.name, f"cannot be read in Initialization Mode of {name}: {refusal}")
                continue
            expected = _starts(variable)
            if expected is not None and not np.array_equal(found, np.broadcast_to(expected, found.shape)):
                yield error(variable.name, f"found start {_text(found)} in the binary, expected {_text(expected)}")
            if not np.all(np.isfinite(found)):
                yield error(variable.name, f"found {_text(found)} in Initialization Mode, expected finite values")


def _starts(variable: Any) -> FloatArray | None:
    """The start values that the binary must have, or None if there are none."""
    exact = variable.initial == "exact" or variable.causality in ("input", "parameter", "structuralParameter")
    if variable.start is None or not exact:
        return None
    numbers = {"true": 1.0, "false": 0.0}
    values = [numbers[text] if text in numbers else float(text) for text in str(variable.start).split()]
    return np.array(values) if len(values) in (1, size_of(variable)) else None


def _text(values: FloatArray) -> str:
    """Numbers with all digits; the first four of many."""
    texts = [repr(value) for value in values.ravel()[:4].tolist()]
    return " ".join(texts) + (" …" if values.size > 4 else "")


def setting_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """Parameters and inputs can be set to what they are wherever the standard allows it, tunable ones to others."""
    with Instance(folder, description, name) as instance:
        instance.initialise()
        settable = [v for v in description.modelVariables if v.causality in ("input", "parameter") and is_numeric(v)]
        values = {variable.name: instance.get([variable]) for variable in settable}
        for variable in settable:
            yield from _set(instance, variable, values[variable.name], "Initialization Mode")
        instance.run()
        for variable in settable:
            tuned = variable.variability == "tunable" and instance.co_simulation
            present = values[variable.name]
            if tuned and is_float(variable):  # some units accept what stays as it is whatever the variability
                small = 1e-6 * np.where(present == 0.0, 1.0, present)
                yield from _set(instance, variable, present + small, "a run", present - small)
            if tuned or variable in continuous_inputs(description):
                yield from _set(instance, variable, present, "a run")


def _set(
    instance: Instance, variable: Any, values: FloatArray, when: str, others: FloatArray | None = None
) -> Iterator[Finding]:
    """An error if the values are refused, and `others`, too."""
    try:
        instance.set([variable], values)
    except RefusedError as refusal:
        if others is not None:
            yield from _set(instance, variable, others, when)
            return
        what = f"{variable.variability} {variable.causality}"
        yield error(variable.name, f"is declared as a {what}, but in {when} of {instance.interface} {refusal}")


def state_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """A run continues bitwise equally from a restored state, that of another instance, too, if it was serialised."""
    flags = interfaces(description)[name]
    h = duration(description) if name == "CoSimulation" else 0.0
    if not flags.canGetAndSetFMUstate:
        if flags.canSerializeFMUstate:
            yield error(f"{name}/canSerializeFMUstate", "is declared without canGetAndSetFMUstate")
        return
    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        move(instance, 1)
        state = instance.save()
        expected = move(instance, 3)
        instance.restore(state)
        instance.time -= 3 * h
        if not np.array_equal(move(instance, 3), expected, equal_nan=True):
            yield error(f"{name}/canGetAndSetFMUstate", "after a saved state was restored the run differed")
        if not flags.canSerializeFMUstate:
            instance.free_state(state)
            return
        content, time = instance.serialise(state), instance.time - 3 * h
        instance.free_state(state)
    with Instance(folder, description, name) as instance:  # another one: bytes outlive what they were made of
        instance.initialise()
        instance.run()
        copy = instance.deserialise(content)
        instance.restore(copy)
        instance.time = time
        if not np.array_equal(move(instance, 3), expected, equal_nan=True):
            yield error(f"{name}/canSerializeFMUstate", "in a new instance with a serialised state the run differed")
        instance.free_state(copy)


def step_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """Steps of unequal length and output derivatives, where they are declared."""
    if name != "CoSimulation":
        return
    flags, h = description.coSimulation, duration(description)
    outputs = [v for v in description.modelVariables if v.causality == "output" and is_float(v)]
    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        instance.step(h)
        if flags.canHandleVariableCommunicationStepSize:
            yield from _callable(f"{name}/canHandleVariableCommunicationStepSize", _unequal_steps, instance, h)
        order = int(flags.maxOutputDerivativeOrder or 0)
        for each in range(1, order + 1):
            yield from _callable(f"{name}/maxOutputDerivativeOrder", instance.output_derivatives, outputs, each)
        if order and outputs:
            yield from _rate_findings(instance, outputs, h)


def _unequal_steps(instance: Instance, h: float) -> None:
    for factor in (0.5, 1.7, 0.01, 1.0):
        instance.step(factor * h)


def _callable(subject: str, call: Callable[..., Any], *arguments: Any) -> Iterator[Finding]:
    """A declared function can be called."""
    try:
        call(*arguments)
    except RefusedError as refusal:
        yield error(subject, f"is declared, but {refusal}")


def _rate_findings(instance: Instance, outputs: list[Any], h: float) -> Iterator[Finding]:
    """First output derivatives: the mean of both ends of a short step against the change of the outputs over it."""
    small = 1e-3 * h
    try:
        before, rates = instance.get(outputs), instance.output_derivatives(outputs, 1)
        instance.step(small)
        after, later = instance.get(outputs), instance.output_derivatives(outputs, 1)
    except RefusedError:
        return  # reported already
    if np.array_equal(after, before):
        return  # the unit's internal steps are longer than this one
    change, expected = (after - before) / small, (rates + later) / 2
    noise = 1e-4 * np.abs(expected) + 1e-10 * (np.abs(before) + np.abs(after)) / small + 1e-4 * np.abs(later - rates)
    names = [output.name for output in outputs for _ in range(size_of(output))]
    for place in np.flatnonzero(np.abs(change - expected) > noise + 1e-9):
        yield error(
            names[place], f"found output derivative {expected[place]:.9g}, expected {change[place]:.9g} by differences"
        )


def vector_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """The vectors of states and derivatives are in the order of ModelStructure/Derivatives."""
    if name != "ModelExchange" or not states(description):
        return
    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        vector = instance.get_states()
        instance.set_states(vector + 0.01 * np.arange(1.0, vector.size + 1.0))  # all different
        for rates, variables in ((False, states(description)), (True, [u.variable for u in description.derivatives])):
            vector, values = instance.get_states(rates), instance.get(variables)
            names = [variable.name for variable in variables for _ in range(size_of(variable))]
            for place in np.flatnonzero(vector != values):
                what = "derivatives" if rates else "states"
                yield error(
                    names[place],
                    f"found {values[place]:.17g}, expected {vector[place]:.17g} as in the vector of {what}",
                )


def indicator_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """There are as many event indicators as declared, and they are finite; of FMI 2, which tells their number alone."""
    if name != "ModelExchange" or description.fmiVersion != "2.0":
        return
    declared = int(description.numberOfEventIndicators or 0)
    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        values = (ctypes.c_double * declared)()
        try:
            instance.call("getEventIndicators", values, declared)
        except RefusedError as refusal:
            yield error("numberOfEventIndicators", f"found {declared}, but {refusal}")
            return
    if not np.isfinite(values).all():
        yield error("numberOfEventIndicators", f"found indicators {list(values)}, expected finite values")


def state_rate_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """State derivatives in Co-Simulation: the mean of both ends of a short step against the change of the states."""
    if name != "CoSimulation" or not states(description) or description.coSimulation.fixedInternalStepSize:
        return
    if not description.coSimulation.canHandleVariableCommunicationStepSize:
        return
    variables, rates = states(description), [unknown.variable for unknown in description.derivatives]
    h = 1e-3 * duration(description)
    with Instance(folder, description, name) as instance:
        instance.initialise()
        instance.run()
        instance.step(duration(description))
        before, first = instance.get(variables), instance.get(rates)
        instance.step(h)
        after, second = instance.get(variables), instance.get(rates)
    if np.array_equal(after, before):
        return  # the unit's internal steps are longer than this one
    change, expected = (after - before) / h, (first + second) / 2
    noise = 1e-4 * (np.abs(expected) + np.abs(second - first)) + 1e-10 * np.abs(before) / h + 1e-9
    names = [rate.name for rate in rates for _ in range(size_of(rate))]
    for place in np.flatnonzero(np.abs(change - expected) > noise):
        yield error(
            names[place], f"found {expected[place]:.9g}, expected {change[place]:.9g}, by which its state changes"
        )


def instance_findings(folder: Path, description: Any, name: str) -> Iterator[Finding]:
    """A second instance does not change the first, and memory functions are called only where that is declared."""
    flags = interfaces(description)[name]
    outputs = [v for v in description.modelVariables if v.causality == "output" and is_float(v)]
    with Instance(folder, description, name) as first:
        first.initialise()
        first.run()
        if not flags.canBeInstantiatedOnlyOncePerProcess:
            before = first.get(outputs)
            with Instance(folder, description, name) as second:
                second.initialise()
                second.run()
                move(second, 2)
                if not np.array_equal(first.get(outputs), before, equal_nan=True):
                    yield error(f"{name}/canBeInstantiatedOnlyOncePerProcess", "a second instance changed the first")
        move(first, 2)
        if flags.canNotUseMemoryManagementFunctions and first.allocations:
            subject = f"{name}/canNotUseMemoryManagementFunctions"
            yield error(subject, f"is declared, but allocateMemory was called {counted(first.allocations, 'time')}")
        for category in description.logCategories:
            if category.name:
                subject = f"LogCategories/{category.name}"
                yield from _callable(subject, first.call, "setDebugLogging", True, [category.name])
        first.call("terminate")
        first.call("reset")


PROBES: dict[str, Probe] = {
    "instantiation": token_findings,
    "start values": start_findings,
    "setting values": setting_findings,
    "saved states": state_findings,
    "steps": step_findings,
    "vectors of states": vector_findings,
    "event indicators": indicator_findings,
    "change of states": state_rate_findings,
    "instances": instance_findings,
}
