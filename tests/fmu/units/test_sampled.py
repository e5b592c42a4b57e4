"""What all sampled units share, tried with one that sums its inputs: declarations, refusals, saved states."""

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmpy.validation import validate_fmu

from baryscope.fmu.check import check_unit
from baryscope.fmu.generate.build import pack_unit
from baryscope.fmu.units.blueprint import Blueprint, Core, Setting
from baryscope.models.checks import Check, CheckSet
from baryscope.models.variables import Kind, Variable
from importer import Importer
from importer3 import Importer3

HEADER = "typedef struct { double sum; } Model;\n"
SOURCE = """#include "unit.h"
#include <stdio.h>
static void model_start(Model *model, double *values, double time)
{
    for (int i = 0; i < N_OUTPUTS; i++) values[AT_OUTPUTS + i] = 0.0;
    model->sum = time;
}
static void model_tune(Model *model, const double *values) { model->sum += 1000.0 * values[AT_PARAMETERS]; }
static bool model_step(Model *model, double *values, double time, double next, char *message)
{
    if (values[0] == 13.0) { snprintf(message, MESSAGE_SIZE, "x[1]: found 13"); return false; }
    for (int i = 0; i < 3; i++) if (values[AT_INPUTS + 3 + i] != 0.0) model->sum += values[i] * (next - time);
    for (int i = 0; i < 3; i++) values[AT_OUTPUTS + i] = values[AT_PARAMETERS] * model->sum;
    for (int i = 0; i < 3; i++) values[AT_OUTPUTS + 3 + i] = values[i] > 0.0;
    return true;
}
"""


@pytest.fixture(scope="module")
def summing():
    gain = ca.SX.sym("gain")
    checks = CheckSet.over(gain, (Check("gain", "gain", "a value above 0", "value", gain, gain),), "unit")
    table = (
        Variable("x", Kind.INPUT, "m", "What is summed", (3,)),
        Variable("taken", Kind.INPUT, "1", "Whether it is", (3,), boolean=True, discrete=True, per_feature=True),
        Variable("gain", Kind.PARAMETER, "1", "By which the sum is multiplied", tunable=True),
        Variable("y", Kind.OUTPUT, "1", "Three times the same sum", (3,), discrete=True),
        Variable("positive", Kind.OUTPUT, "1", "Of x", (3,), boolean=True, discrete=True, per_feature=True),
    )
    return Blueprint(
        name="Summing",
        summary="A sum",
        variables=table,
        starts={"x": np.zeros(3), "taken": np.ones(3), "gain": np.array(2.0)},
        core=Core(
            functions=(checks.margins, checks.found),
            checks={"CHECKS": checks.checks},
            headers=("summing.h", "sampled.h"),
            files=("summing.c", "sampled.c"),
            generated={"summing.h": HEADER, "summing.c": SOURCE},
        ),
        setting=Setting(labels=("one", "two", "three"), facts=(("scenario", "none"),), stop_time=10.0, step_size=0.5),
        sections=(),
        use=("Sum.",),
    )


@pytest.mark.parametrize("fmi, scalar", [(2, False), (3, False), (3, True)])
def test_its_declarations_are_true(summing, tmp_path, fmi, scalar):
    unit = pack_unit(summing, tmp_path / "s.fmu", fmi=fmi, scalar=scalar)
    assert validate_fmu(str(unit)) == []
    assert check_unit(unit, isolated=False) == []
    description = fmpy.read_model_description(str(unit))
    assert description.modelExchange is None
    kinds = {v.name: (v.type, v.variability, v.description) for v in description.modelVariables}
    name = "taken" if fmi == 3 and not scalar else "taken[2]"
    label = "one, two, three" if name == "taken" else "two"
    assert kinds[name][:2] == ("Boolean", "discrete")
    assert kinds[name][2].endswith(label)


def test_it_steps_and_refuses_what_it_has_not(summing, opened, tmp_path):
    importer = opened(Importer, pack_unit(summing, tmp_path / "s.fmu"))
    s, at = importer.fmu, importer.references
    importer.initialise()
    assert importer.messages == []
    x, taken = [at[f"x[{k}]"] for k in (1, 2, 3)], [at[f"taken[{k}]"] for k in (1, 2, 3)]
    s.setReal(x, [1.0, -2.0, 4.0])
    s.setBoolean(taken, [True, False, True])
    s.doStep(0.0, 0.5)
    assert s.getReal([at["y[2]"]]) == [5.0]
    assert [bool(b) for b in s.getBoolean([at[f"positive[{k}]"] for k in (1, 2, 3)])] == [True, False, True]
    state = s.getFMUstate()
    s.setReal([at["gain"]], [1.0])
    s.doStep(0.5, 0.5)
    later = s.getReal([at["y[1]"]])
    assert later == [1005.0]
    s.setFMUstate(state)
    s.setReal([at["gain"]], [1.0])
    s.doStep(0.5, 0.5)
    assert s.getReal([at["y[1]"]]) == later
    importer.refused(lambda: s.setReal([at["gain"]], [0.0]), "gain: found value 0, expected a value above 0")
    importer.refused(lambda: s.setReal(x[:1], [float("nan")]), "expected a finite value")
    s.setReal(x[:1], [13.0])
    importer.refused(lambda: s.doStep(1.0, 0.5), "x[1]: found 13")
    s.setReal(x[:1], [1.0])
    s.doStep(1.0, 0.5)
    importer.refused(lambda: s.getDirectionalDerivative([at["y[1]"]], x[:1], [1.0]), "is sampled")
    importer.refused(lambda: s.setRealInputDerivatives(x[:1], [1], [1.0]), "is sampled")


def test_model_exchange_is_refused(summing, tmp_path):
    class Model(Importer):
        kind = FMU2Model

    with pytest.raises(Exception, match="instantiate"):
        Model(pack_unit(summing, tmp_path / "s.fmu"), tmp_path)


def test_arrays_of_booleans_in_fmi_3(summing, opened, tmp_path):
    importer = opened(Importer3, pack_unit(summing, tmp_path / "s.fmu", fmi=3))
    s, at = importer.fmu, importer.references
    importer.initialise()
    s.setFloat64([at["x"]], [1.0, -2.0, 4.0])
    s.setBoolean([at["taken"]], [True, True, False])
    s.doStep(0.0, 1.0)
    assert s.getFloat64([at["y"]], 3) == [-2.0] * 3
    assert [bool(b) for b in s.getBoolean([at["positive"]], 3)] == [True, False, True]
