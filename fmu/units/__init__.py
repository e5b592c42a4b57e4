"""The units that `baryscope build --unit` makes: one file each, which says all that tells it from the others.

To add a unit: a table of variables and, where there are equations, CasADi functions in models/; a C core in fmu/csrc/;
a file here with a `UnitKind`, and its line in UNITS. A sampled unit (no continuous states; its outputs change in
communication steps) has the least to write in C: a header with a struct `Model` without pointers, and a file with
model_start, model_tune and model_step, which fmu/csrc/sampled.h describes. Its `Core` is

    Core(functions, {"CHECKS": checks.checks}, headers=("mine.h", "sampled.h"), files=("mine.c", "sampled.c"))

where `functions` holds the CasADi functions that mine.c calls, and the two of `CheckSet.over(p, checks, "unit")`.
In C a variable's place among the values has its name: that of `sample.time` is AT_SAMPLE_TIME.
"""

from baryscope.fmu.units.blueprint import Blueprint, UnitKind
from baryscope.fmu.units.controller import CONTROLLER
from baryscope.fmu.units.estimator import ESTIMATOR
from baryscope.fmu.units.rig import RIG
from baryscope.fmu.units.target import TARGET
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario

UNITS: dict[str, UnitKind] = {"target": TARGET, "rig": RIG, "estimator": ESTIMATOR, "controller": CONTROLLER}
"""By the names of `--unit`."""


def blueprint_of(unit: str, scenario: Scenario) -> Blueprint:
    """A unit of a scenario.

    Raises:
        InputError: there is no such unit.
    """
    if unit not in UNITS:
        raise InputError(f"unit: found {unit!r}, expected one of {', '.join(UNITS)}")
    return UNITS[unit].blueprint(scenario)


__all__ = ["UNITS", "Blueprint", "UnitKind", "blueprint_of"]
