"""Extreme numbers, and values that are not numbers: each is computed with, or refused in one line.

Warnings are errors in the tests.
"""

import numpy as np
import pytest

from baryscope.fmu import Session, simulate
from baryscope.fmu.runtime import UnitError
from baryscope.models.errors import InputError
from baryscope.models.scenario import Scenario
from baryscope.models.variables import Kind, variable_table
from baryscope.scripts.cli.simulate import fly

EXTREMES = [1e150, -1e150, 1e300, 1.7e308, 5e-324, 1e-300, -1e-150, 1e20]
PARAMETERS = [v for v in variable_table(12) if v.kind == Kind.PARAMETER and not v.boolean]


@pytest.fixture(scope="module")
def session(envisat_fmu):
    with Session(envisat_fmu) as session:
        yield session


def computed_or_refused(work):
    """The outputs of `work`, which must be finite, or its refusal, which must be one line."""
    try:
        outputs = work()
    except (InputError, UnitError) as refusal:
        outputs = str(refusal)
    assert len(outputs.splitlines()) == 1 if isinstance(outputs, str) else np.all(np.isfinite(outputs))
    return outputs


@pytest.mark.parametrize("extreme", EXTREMES)
@pytest.mark.parametrize("variable", PARAMETERS, ids=lambda variable: variable.name)
def test_extreme_parameters(session, envisat, variable, extreme):
    def run(value):
        session.reset({variable.name: value})
        session.step(1.0)
        return session.outputs

    one = np.array(envisat.parameters()[variable.name])
    one.flat[0] = extreme
    computed_or_refused(lambda: run(one))
    computed_or_refused(lambda: run(np.full(variable.shape, extreme)))


@pytest.mark.parametrize("extreme", [x for x in EXTREMES if x != 1e20])  # 1e20: 20 million steps, and then refused
@pytest.mark.parametrize("name", ["torque", "acceleration"])
@pytest.mark.parametrize("gravity_gradient", [False, True])
def test_extreme_inputs(session, name, extreme, gravity_gradient):
    def run():
        session.reset({"gravityGradient": gravity_gradient})
        session.step(1.0, **{name: [0.0, extreme, 0.0]})
        return session.outputs

    computed_or_refused(run)


@pytest.mark.parametrize("extreme", EXTREMES)
def test_extreme_times(envisat_fmu, session, extreme):
    def step(**times):
        session.reset(**times)
        session.step(1.0)
        return session.outputs

    def step_by():
        session.reset()
        session.step(extreme)
        return session.outputs

    computed_or_refused(lambda: step(start_time=extreme))
    computed_or_refused(lambda: step(stop_time=extreme))
    computed_or_refused(lambda: step(tolerance=extreme))
    if extreme != 1e20:
        computed_or_refused(step_by)
        computed_or_refused(lambda: simulate(envisat_fmu, [0.0, extreme]).values)
    computed_or_refused(lambda: simulate(envisat_fmu, [-abs(extreme), abs(extreme)]).values)


@pytest.mark.parametrize("value, shown", [
    pytest.param("near", "'near'", id="text"),
    pytest.param([["a"]], "'a'", id="list of text"),
    pytest.param([1, [2]], "[1, [2]]", id="ragged"),
    pytest.param(10**400, "1000", id="huge"),
    pytest.param([1j] * 3, "1j", id="complex"),
    pytest.param(object(), "object", id="object"),
])  # fmt: skip
def test_values_that_are_no_numbers_are_refused_by_the_argument_s_name(envisat_fmu, session, value, shown):
    def refusal(name, work):
        with pytest.raises(InputError) as raised:
            work()
        assert str(raised.value).startswith(f"{name}: found ")
        assert shown in str(raised.value)
        assert "\n" not in str(raised.value)
        assert len(str(raised.value)) < 200

    session.reset()
    refusal("chaser.position0", lambda: session.reset({"chaser.position0": value}))
    refusal("start_time", lambda: session.reset(start_time=value))
    refusal("stop_time", lambda: session.reset(stop_time=value))
    refusal("tolerance", lambda: session.reset(tolerance=value))
    session.reset()
    refusal("target.torque", lambda: session.step(1.0, torque=value))
    refusal("duration", lambda: session.step(value))
    refusal("times", lambda: simulate(envisat_fmu, value))
    assert session.time == 0


def test_durations_of_any_numeric_type(session):
    session.reset()
    for one in (1, np.float32(1), np.array(1.0), np.int64(1)):
        session.step(one)
    assert session.time == 4.0


def test_complex_inputs_are_refused(session):
    session.reset()
    with pytest.raises(InputError, match=r"target\.torque: found .*expected real numbers"):
        session.step(1.0, torque=np.ones(3, complex))


def test_nan_is_refused_as_a_boolean(session):
    with pytest.raises(InputError, match="gravityGradient: found nan, expected true or false"):
        session.reset({"gravityGradient": np.nan})


def test_a_tolerance_beyond_rounding_is_refused_before_it_costs_20_million_steps(session):
    with pytest.raises(InputError, match="tolerance: found 1e-300, expected a value of at least 1e-15"):
        session.reset(tolerance=1e-300)


# ---- scenarios ----


def numbers_of(table, path=()):
    """The places of a scenario's numbers; of lists, the first item's."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield from numbers_of(value, (*path, key))
    elif isinstance(table, tuple):
        yield from numbers_of(table[0], (*path, 0))
    elif isinstance(table, float):
        yield path


def changed(table, path, value):
    if not path:
        return value
    place, *rest = path
    if isinstance(table, tuple):
        return (changed(table[0], rest, value), *table[1:])
    return table | {place: changed(table[place], rest, value)}


@pytest.fixture(scope="module", params=["noise", "stereo"])
def tables(envisat, request):
    """Envisat's file with all options, for a few seconds."""
    outliers = {"share": 0.05, "size": 2.0, "swapped": 0.02, "stretch": 3.0, "sliding": 1, "sliding_speed": 0.005}
    stereo = {"focal_length": 1000.0, "baseline": 0.5, "pixel_noise": 0.3}
    noise = {"stereo": stereo} if request.param == "stereo" else {"noise": 0.02}
    return envisat.model_dump() | {
        "tracking": {"intervals": ({"start": 0.0, "end": 3.0, "features": ("array-tip",)},), "max_incidence_deg": 80.0},
        "sensor": noise | {"dropout": 0.1, "outliers": outliers},
        "run": {"duration": 5.0, "sample_time": 1.0, "seed": 1, "tolerance": 1e-13},
    }


@pytest.mark.parametrize("extreme", [*EXTREMES, 1e30, -1e30, 1e-30, 1e12])
def test_extreme_numbers_in_a_scenario(tables, envisat_fmu, extreme):
    places = list(numbers_of(tables))
    assert len(places) > 20
    for path in places:

        def run(path=path):
            scenario = Scenario.parse(changed(tables, path, extreme), "file.toml")
            return np.nan_to_num(fly(scenario, envisat_fmu).tracks.position, nan=0.0, posinf=np.inf)

        found = computed_or_refused(run)
        if abs(extreme) > 1e100:
            assert isinstance(found, str), path
            assert found.startswith("file.toml: "), path
