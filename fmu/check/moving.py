"""Moves an instance to other points: parameters, inputs and states, and what changes with them."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from baryscope.fmu.check.description import is_float, size_of, states
from baryscope.fmu.check.instance import FloatArray, Instance, RefusedError

Setter = Callable[[Sequence[Any], FloatArray], None]
PERTURBED = ("Real", "Float64", "Boolean")


def duration(description: Any) -> float:
    """The communication step: the default experiment's, else 1/1000 of its length or 100 internal steps of the unit."""
    experiment = description.defaultExperiment
    if experiment is None:
        return 0.01
    if experiment.stepSize:
        return float(experiment.stepSize)
    length = float(experiment.stopTime or 1.0) - float(experiment.startTime or 0.0)
    fixed = description.coSimulation.fixedInternalStepSize if description.coSimulation is not None else None
    return min(length / 1000, 100 * float(fixed)) if fixed else length / 1000


def move(instance: Instance, steps: int) -> FloatArray:
    """Take some steps, or change the continuous states; return the outputs."""
    for _ in range(steps):
        if instance.co_simulation:
            instance.step(duration(instance.description))
        else:
            states = instance.get_states()
            instance.set_states(states + 1e-3 * instance.get_states(rates=True))
    return instance.get([v for v in instance.description.modelVariables if v.causality == "output" and is_float(v)])


def perturb(instance: Instance, knowns: list[Any], unknowns: list[Any], rng: np.random.Generator, point: int) -> None:
    """Move every known away from its value, as far as the unit accepts it; Booleans are true at every other point."""
    for known in knowns:
        value = instance.get([known])
        if not is_float(known):
            instance.set([known], np.full(value.shape, point % 2))
            continue
        direction = rng.uniform(0.3, 1.0, value.shape) * np.where(value == 0.0, 1.0, value)
        for share in (0.1, -0.1, 1e-2, 1e-3, 1e-4, -1e-4, 0.0):
            try:
                instance.set([known], value + share * direction)
                instance.get(unknowns)
                break
            except RefusedError:
                continue


def scatter(instance: Instance, inputs: list[Any], rng: np.random.Generator) -> None:
    """Move inputs and, where they can be set, states away from rest."""
    if inputs:
        instance.set(inputs, instance.get(inputs) + rng.uniform(0.1, 1.0, total(inputs)))
    if not instance.co_simulation and states(instance.description):
        vector = instance.get_states()
        instance.set_states(vector + 0.05 * rng.uniform(0.2, 1.0, vector.size) * np.where(vector == 0.0, 1.0, vector))


def setter_in_a_run(instance: Instance) -> Setter:
    """A function that sets inputs, tunable parameters and, in Model Exchange, states, each as the standard asks."""
    vector_of = states(instance.description)
    places = {state.name: place for state, place in zip(vector_of, slices(vector_of), strict=True)}

    def set_all(variables: Sequence[Any], values: FloatArray) -> None:
        parts = list(zip(variables, np.split(values, [s.stop for s in slices(variables)][:-1]), strict=True))
        state = [(variable, part) for variable, part in parts if variable.name in places]
        tuned = [(variable, part) for variable, part in parts if variable.causality == "parameter"]
        inputs = [(variable, part) for variable, part in parts if variable.causality == "input"]
        for group, setter in ((tuned, instance.tune), (inputs, instance.set)):
            if group:
                setter([variable for variable, _ in group], np.concatenate([part for _, part in group]))
        if state:
            vector = instance.get_states()
            for variable, part in state:
                vector[places[variable.name]] = part
            instance.set_states(vector)

    return set_all


def change(
    instance: Instance,
    unknowns: list[Any],
    knowns: Sequence[Any],
    setter: Setter,
    values: FloatArray,
    moved: FloatArray,
) -> FloatArray:
    """The change of the unknowns from `values` to `moved`; zero where the unit refuses the latter."""
    here = instance.get(unknowns)
    try:
        setter(knowns, moved)
        there = instance.get(unknowns)
    except RefusedError:
        there = here
    setter(knowns, values)
    return there - here


def movable(instance: Instance, unknowns: list[Any], knowns: list[Any], setter: Setter, step: float) -> list[Any]:
    """The knowns that the unit accepts a little away from their values, by `step` of their size to both sides.

    All are tried together, and where that is refused halves of them, so that many of them take little time.
    """
    if not knowns:
        return []
    values = instance.get(knowns)
    try:
        for sign in (1.0, -1.0):
            setter(knowns, values + sign * step * np.maximum(np.abs(values), 1.0))
            instance.get(unknowns)
    except RefusedError:
        setter(knowns, values)
        half = len(knowns) // 2
        if not half:
            return []
        return [k for part in (knowns[:half], knowns[half:]) for k in movable(instance, unknowns, part, setter, step)]
    setter(knowns, values)
    return knowns


def total(variables: Sequence[Any]) -> int:
    """The number of scalars of some variables."""
    return sum(size_of(variable) for variable in variables)


def slices(variables: Sequence[Any]) -> list[slice]:
    """The places of each variable's scalars among those of all."""
    ends = np.cumsum([0, *(size_of(variable) for variable in variables)]).tolist()
    return [slice(start, stop) for start, stop in pairwise(ends)]
