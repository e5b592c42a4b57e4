"""The table of variables: names, sizes, units."""

import math
import re

import pytest

from baryscope.models.scenario import load_scenario
from baryscope.models.target import tumbling_target
from baryscope.models.variables import (
    DISPLAY_UNITS,
    FORCE_PARAMETERS,
    UNITS,
    Force,
    Kind,
    Variable,
    forces_of,
    variable_table,
)

COUNTS = [3, 8, 12]
FORCES = [frozenset(), *(frozenset({force}) for force in Force), frozenset(Force)]
BASE_UNITS = {"kg", "m", "s", "A", "K", "mol", "cd", "rad"}  # of FMI


@pytest.mark.parametrize("count", COUNTS)
def test_names_are_unique(count):
    table = variable_table(count)
    names = [name for variable in table for name in variable.scalar_names]
    assert len(names) == len(set(names))
    assert len(table) == len({variable.name for variable in table})


@pytest.mark.parametrize("count", COUNTS)
def test_number_of_scalars(count):
    """J, features and normals, q, ω, elements, chaser, two settings; 6n and 24 outputs; 14 states."""
    sizes = {kind: sum(v.size for v in variable_table(count) if v.kind == kind) for kind in Kind}
    assert sizes == {
        Kind.INPUT: 6,
        Kind.PARAMETER: 6 + 6 * count + 4 + 3 + 7 + 6 + 2,
        Kind.OUTPUT: 6 * count + 24,
        Kind.STATE: 14,
        Kind.DERIVATIVE: 14,
    }


@pytest.mark.parametrize("forces", FORCES, ids=lambda forces: ", ".join(sorted(forces)))
def test_forces_add_their_parameters_and_are_found_by_them(forces):
    plain, table = variable_table(3), variable_table(3, forces)
    parameters = [v.name for v in table if v.kind == Kind.PARAMETER]
    assert parameters[: len(parameters) - sum(len(FORCE_PARAMETERS[f]) for f in forces)] == [
        v.name for v in plain if v.kind == Kind.PARAMETER
    ]
    assert forces_of(parameters) == forces_of(n for v in table for n in v.scalar_names) == forces
    assert (table == plain) == (not forces)
    assert sum(v.size for v in table if v.kind == Kind.STATE) == (20 if forces else 14)


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("forces", FORCES, ids=lambda forces: ", ".join(sorted(forces)))
def test_every_variable_is_described(count, forces):
    for variable in variable_table(count, forces):
        assert variable.unit in UNITS
        assert variable.description == variable.description.strip() != ""
        assert len(variable.scalar_names) == variable.size
        name = variable.name.removeprefix("der(").removesuffix(")")
        assert re.fullmatch(r"[a-z][A-Za-z0-9]*(\.[a-z][A-Za-z0-9]*)*", name)
        if variable.shape == (4,):
            assert "quaternion" in variable.description
            assert "(w, x, y, z)" in variable.description


@pytest.mark.parametrize("forces", FORCES, ids=lambda forces: ", ".join(sorted(forces)))
def test_a_derivative_stands_for_each_state(forces):
    """Same shape, and the state's unit by the second."""
    table = {variable.name: variable for variable in variable_table(3, forces)}
    states = [variable for variable in table.values() if variable.kind == Kind.STATE]
    for state in states:
        rate = table[f"der({state.name})"]
        assert (rate.kind, rate.shape) == (Kind.DERIVATIVE, state.shape)
        by_the_second = UNITS[state.unit] | {"s": UNITS[state.unit].get("s", 0) - 1}
        assert UNITS[rate.unit] == by_the_second
    assert table["der(state.position)"].scalar_names[2] == "der(state.position[3])"


def test_scalar_names_go_row_by_row_from_1():
    features = Variable("features", Kind.OUTPUT, "m", "positions", (2, 3))
    assert features.scalar_names == [
        "features[1,1]", "features[1,2]", "features[1,3]", "features[2,1]", "features[2,2]", "features[2,3]"
    ]  # fmt: skip
    assert Variable("rate", Kind.INPUT, "rad/s", "rate", (3,)).scalar_names == ["rate[1]", "rate[2]", "rate[3]"]
    assert Variable("e", Kind.PARAMETER, "1", "eccentricity").scalar_names == ["e"]


def test_booleans():
    assert [v.name for v in variable_table(3) if v.boolean] == ["gravityGradient"]


def test_units_are_made_of_base_units():
    for exponents in UNITS.values():
        assert set(exponents) <= BASE_UNITS
    newton = {"kg": 1, "m": 1, "s": -2}
    assert UNITS["N.m"] == newton | {"m": 2} == UNITS["J"]


@pytest.mark.parametrize("forces", [frozenset(), frozenset(Force)], ids=["none", "all"])
def test_every_scalar_has_a_description_of_its_own(forces):
    labels = ["corner", "hinge", "tip"]
    table = variable_table(3, forces)
    texts = [variable.scalar_description(k, labels) for variable in table for k in range(variable.size)]
    assert len(texts) == len(set(texts)) == sum(variable.size for variable in table)
    wholes = [variable.whole_description(labels) for variable in table]
    assert len(wholes) == len(set(wholes))
    described = {
        v.name: {name: v.scalar_description(k, labels) for k, name in enumerate(v.scalar_names)} for v in table
    }
    assert (
        described["features"]["features[2,3]"] == "Positions of the features, frame C (chaser, inertial axes): hinge, z"
    )
    assert described["target.attitude"]["target.attitude[1]"].endswith("body to inertial: w")
    assert described["chaser.position"]["chaser.position[2]"].endswith("LVLH axes: y, along-track")
    assert "rows: corner, hinge, tip" in next(v for v in table if v.name == "normals").whole_description(labels)


@pytest.mark.parametrize("forces", [frozenset(), frozenset(Force)], ids=["none", "all"])
def test_angles_are_displayed_in_degrees_and_the_orbit_in_kilometres(forces):
    """Factors against the definitions: a turn has 360 degrees, a kilometre 1000 m."""
    table = {variable.name: variable for variable in variable_table(3, forces)}
    for variable in table.values():
        assert variable.display_unit == variable.unit or variable.display_unit in DISPLAY_UNITS[variable.unit]
        if UNITS[variable.unit].get("rad"):
            assert variable.display_unit == variable.unit.replace("rad", "deg")
            assert DISPLAY_UNITS[variable.unit][variable.display_unit] * 2 * math.pi == pytest.approx(360, rel=1e-15)
    assert table["orbit.semiMajorAxis"].display_unit == "km"
    assert table["orbit.gravitationalParameter"].display_unit == "km3/s2"
    assert DISPLAY_UNITS["m3/s2"]["km3/s2"] == pytest.approx(DISPLAY_UNITS["m"]["km"] ** 3)
    assert table["features"].display_unit == table["chaser.position"].display_unit == "m"


def test_limits_are_where_the_unit_begins_to_refuse():
    """By the checks of the parameters: all of them hold within the limits, one fails beside each."""
    system, scenario = tumbling_target(12), load_scenario("envisat")
    p = scenario.flat_parameters()
    parameters = [v for v in system.of_kind(Kind.PARAMETER) for _ in range(v.size)]
    bounded = {v.name: place for place, v in enumerate(parameters) if v.limits != (-math.inf, math.inf)}
    assert sorted(bounded) == [
        "orbit.eccentricity", "orbit.gravitationalParameter", "orbit.semiMajorAxis", "solver.tolerance",
        "target.inertia.xx", "target.inertia.yy", "target.inertia.zz",
    ]  # fmt: skip
    for name, place in bounded.items():
        for limit, away in zip(parameters[place].limits, (-1, 1), strict=True):
            if not math.isfinite(limit):
                continue
            outside = p.copy()
            outside[place] = limit + away * (0.01 * abs(limit) + 1e-9)
            assert system.checks.failure(outside) is not None, name
    for name, values in {"orbit.eccentricity": (0.0, 1 - 2**-53), "solver.tolerance": (1e-15, 1e-3)}.items():
        for value in values:
            inside = p.copy()
            inside[bounded[name]] = value
            assert system.checks.failure(inside) is None
