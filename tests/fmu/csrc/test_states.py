"""States at which the equations have no value are refused: where the attitude has no direction."""

import ctypes

import numpy as np
import pytest

from importer import Importer


@pytest.mark.parametrize(
    "attitude, length", [([0.0] * 4, "0"), ([1e-200, 0.0, 0.0, 0.0], "0"), ([0.0, 1e200, 0.0, 0.0], "inf")]
)
def test_outputs_of_a_quaternion_without_a_direction_are_refused(model, attitude, length):
    """Set one by one, states may pass through such values: they are refused where they matter."""
    m, references = model.fmu, [model.references[f"state.attitude[{k}]"] for k in (1, 2, 3, 4)]
    words = "state.attitude", f"found length {length}", "expected a quaternion with a direction"
    model.initialise()
    before = m.getReal(references)
    feature, rate = ([model.references[name]] for name in ("features[1,1]", "der(state.angularRate[1])"))
    for reference, value in zip(references, attitude, strict=True):
        m.setReal([reference], [value])
    assert m.getReal(references) == attitude
    model.refused(lambda: m.getReal(feature), "fmi2GetReal", *words)
    model.refused(lambda: m.getReal(rate), "fmi2GetReal", *words)
    model.refused(lambda: m.getDirectionalDerivative(feature, references, [1.0] * 4), "Derivative", *words)
    m.newDiscreteStates()
    m.enterContinuousTimeMode()
    values = (ctypes.c_double * 14)()
    model.refused(lambda: m.getDerivatives(values, 14), "fmi2GetDerivatives", *words)
    m.setReal(references, before)
    assert np.all(np.isfinite(m.getReal([r for name, r in model.references.items() if name != "gravityGradient"])))
    m.getDerivatives(values, 14)
    assert np.all(np.isfinite(values))


@pytest.mark.parametrize(
    "value, words",
    [
        (0.0, ("state.attitude", "found length 0", "a quaternion with a direction")),
        (np.nan, ("state 1 is nan", "finite")),
    ],
)
def test_a_vector_of_states_without_outputs_is_refused(model, value, words):
    m, values = model.fmu, (ctypes.c_double * 14)()
    model.initialise()
    m.newDiscreteStates()
    m.enterContinuousTimeMode()
    m.getContinuousStates(values, 14)
    before = list(values)
    values[:4] = [value] * 4
    model.refused(lambda: m.setContinuousStates(values, 14), "fmi2SetContinuousStates", *words)
    m.getContinuousStates(values, 14)
    assert list(values) == before


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_a_start_attitude_without_a_direction_is_refused(envisat_fmu, tmp_path, value):
    unit = Importer(envisat_fmu, tmp_path / "unit")
    references = [unit.references[f"target.attitude0[{k}]"] for k in (1, 2, 3, 4)]
    if np.isfinite(value):
        unit.fmu.setReal(references, [value] * 4)
        unit.refused(unit.initialise, "target.attitude0", "found length 0", "expected a unit quaternion")
    else:
        unit.refused(
            lambda: unit.fmu.setReal(references, [value] * 4), "target.attitude0[1]", str(value), "a finite value"
        )
    unit.fmu.freeInstance()


def test_states_of_fmi_3_without_outputs_are_refused(model3):
    words = "state.attitude", "found length 0", "a quaternion with a direction"
    model3.initialise()
    model3.set("state.attitude", [0.0] * 4)
    model3.refused(lambda: model3.get("features"), "fmi3GetFloat64", *words)
    model3.set("state.attitude", [0.0, 0.0, 2.0, 0.0])
    assert np.all(np.isfinite(model3.get("features")))
