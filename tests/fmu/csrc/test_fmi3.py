"""The FMI 3.0 unit, with arrays and with scalars: the physics and refusals of FMI 2.0, and what is new in FMI 3."""

import ctypes
import math
import xml.etree.ElementTree as ET
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import fmi3Boolean, fmi3Float64
from fmpy.validation import validate_fmu

import oracles
from baryscope.models.variables import Kind, variable_table
from importer import Importer


def description_of(path):
    with zipfile.ZipFile(path) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))  # noqa: S314  our own file


# ---- the file ----


def test_fmpy_validates_it_without_a_message(any_fmu3):
    assert validate_fmu(str(any_fmu3)) == []


def test_starts_are_whole_and_have_all_digits(any_fmu3, envisat):
    root = description_of(any_fmu3)
    values = []
    for element in root.find("ModelVariables"):
        if element.get("causality") == "parameter":
            start = element.get("start").split()
            extents = [int(d.get("start")) for d in element.findall("Dimension")]
            assert len(start) == math.prod(extents)
            values += [{"true": 1.0, "false": 0.0}.get(text, text) for text in start]
    assert np.array_equal(np.array(values, dtype=float), envisat.flat_parameters())


def test_arrays_are_single_variables(envisat_fmu3):
    elements = list(description_of(envisat_fmu3).find("ModelVariables"))
    table = variable_table(12)
    assert [e.get("name") for e in elements] == [v.name for v in table] + ["time"]
    assert [int(e.get("valueReference")) for e in elements] == list(range(len(table) + 1))
    for variable, element in zip(table, elements[:-1], strict=True):
        assert tuple(int(d.get("start")) for d in element) == variable.shape
        assert element.get("description").startswith(variable.description)
        assert element.get("unit") == (None if variable.boolean else variable.unit)


def test_only_existing_capabilities_are_declared(any_fmu3):
    root = description_of(any_fmu3)
    common = {
        "modelIdentifier": "TumblingTarget",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    assert root.find("ModelExchange").attrib == common
    stepping = {"canHandleVariableCommunicationStepSize": "true", "maxOutputDerivativeOrder": "1"}
    assert root.find("CoSimulation").attrib == common | stepping
    assert root.find("ScheduledExecution") is None


def test_dependencies_of_arrays_are_those_of_their_scalars_in_fmi_2(envisat_fmu, any_fmu3):
    """An array depends on what any of its scalars depends on; FMI 2 counts variables from 1.

    FMI 3 also counts tunable parameters among the knowns of a run.
    """
    tunable = {n for v in variable_table(12) if v.tunable for n in (v.name, *v.scalar_names)}
    old = description_of(envisat_fmu)
    owner = [v.name for v in variable_table(12) for _ in range(v.size)]
    scalars = [name for v in variable_table(12) for name in v.scalar_names]
    root = description_of(any_fmu3)
    names = [e.get("name") for e in root.find("ModelVariables")]
    label = owner if "features" in names else scalars
    for element, element3 in (
        ("Outputs", "Output"), ("Derivatives", "ContinuousStateDerivative"), ("InitialUnknowns", "InitialUnknown"),
    ):  # fmt: skip
        expected = {}
        for unknown in old.find(f"ModelStructure/{element}"):
            knowns = {label[int(k) - 1] for k in unknown.get("dependencies").split()}
            expected.setdefault(label[int(unknown.get("index")) - 1], set()).update(knowns)
        found = {
            names[int(u.get("valueReference"))]: {names[int(k)] for k in u.get("dependencies").split()}
            for u in root.findall(f"ModelStructure/{element3}")
        }
        if element != "InitialUnknowns":
            found = {unknown: knowns - tunable for unknown, knowns in found.items()}
        assert found == expected


def test_outputs_and_derivatives_depend_on_tunable_parameters(any_fmu3):
    """As 2.4.8 of FMI 3.0 counts them: a feature on its place in the body, the rates on the gravity gradient."""
    root = description_of(any_fmu3)
    names = [e.get("name") for e in root.find("ModelVariables")]
    tunable = {e.get("name") for e in root.find("ModelVariables") if e.get("variability") == "tunable"}
    unknowns = [*root.findall("ModelStructure/Output"), *root.findall("ModelStructure/ContinuousStateDerivative")]
    found = {
        names[int(u.get("valueReference"))]: {names[int(k)] for k in u.get("dependencies").split()} for u in unknowns
    }
    found = {unknown: knowns & tunable for unknown, knowns in found.items() if knowns & tunable}
    if "features" in names:
        expected = {"features": {"target.features"}, "normals": {"target.normals"}}
        expected["der(state.angularRate)"] = {"gravityGradient"}
    else:
        expected = {
            f"{what}[{i},{axis}]": {f"target.{what}[{i},{k}]" for k in (1, 2, 3)}
            for what in ("features", "normals") for i in range(1, 13) for axis in (1, 2, 3)
        }  # fmt: skip
        expected |= {f"der(state.angularRate[{axis}])": {"gravityGradient"} for axis in (1, 2, 3)}
    assert found == expected


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_it(any_fmu3, envisat, kind):
    scalar = "features" not in {v.name for v in fmpy.read_model_description(str(any_fmu3)).modelVariables}
    names = [f"target.position[{i}]" for i in (1, 2, 3)] if scalar else ["target.position"]
    result = fmpy.simulate_fmu(
        str(any_fmu3), fmi_type=kind, stop_time=100.0, output_interval=10.0, relative_tolerance=1e-10, output=names
    )
    last = np.array([result[name][-1] for name in names]).ravel()
    np.testing.assert_allclose(last, oracles.com_in_chaser_frame(envisat, [100.0])[0], atol=1e-5)


# ---- the same as by FMI 2 ----


def test_outputs_are_bitwise_those_of_fmi_2(importer3, envisat_fmu, tmp_path):
    two = Importer(envisat_fmu, tmp_path / "two")
    outputs = importer3.of_kinds(Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE)
    references = [two.references[s] for name in outputs for s in importer3.table[name].scalar_names]
    two.initialise()
    importer3.initialise()
    torque = [two.references[f"target.torque[{i}]"] for i in (1, 2, 3)]
    for k in range(40):
        if k % 13 == 5:
            two.fmu.setReal(torque, [float(k), -1.0, 0.25])
            importer3.set("target.torque", [float(k), -1.0, 0.25])
        two.fmu.doStep(k * 0.7, 0.7)
        assert importer3.step(k * 0.7, 0.7) == (False, False, False, k * 0.7 + 0.7)
        assert importer3.get(*outputs).tolist() == two.fmu.getReal(references)
    two.fmu.freeInstance()


def test_starts_can_be_read_in_the_state_instantiated(importer3, envisat):
    parameters = importer3.of_kinds(Kind.PARAMETER)
    names = [v.name for v in variable_table(12) if v.kind == Kind.PARAMETER]
    whole = dict(
        zip([s for n in names for s in importer3.table[n].scalar_names], envisat.flat_parameters(), strict=True)
    )
    assert importer3.get(*parameters).tolist() == [
        whole[s] for n in parameters for s in importer3.table[n].scalar_names
    ]
    importer3.set("chaser.position0", [7.0, 8.0, 9.0])
    assert importer3.get("chaser.position0").tolist() == [7.0, 8.0, 9.0]
    importer3.refused(lambda: importer3.get("features"), "fmi3GetFloat64", "Instantiated", "only inputs, parameters")
    importer3.initialise()
    assert importer3.get("chaser.position").tolist() == [7.0, 8.0, 9.0]


def test_time_is_the_independent_variable(importer3):
    time = importer3.references["time"]
    importer3.initialise(startTime=3.0)
    assert importer3.fmu.getFloat64([time]) == [3.0]
    importer3.step(3.0, 0.5)
    assert importer3.fmu.getFloat64([time]) == [3.5]
    importer3.refused(lambda: importer3.fmu.setFloat64([time], [1.0]), "time is calculated")


def test_the_gravity_gradient_is_a_boolean(importer3):
    reference = importer3.references["gravityGradient"]
    importer3.initialise()
    importer3.step(0.0, 10.0)
    before = importer3.get("target.rotationalEnergy")
    assert importer3.fmu.getBoolean([reference]) == [False]
    importer3.fmu.setBoolean([reference], [True])
    assert importer3.fmu.getBoolean([reference]) == [True]
    importer3.step(10.0, 50.0)
    assert importer3.get("target.rotationalEnergy") != pytest.approx(before, rel=1e-9)


# ---- refused calls ----


def test_calls_at_the_wrong_time(importer3):
    s = importer3.fmu
    importer3.refused(lambda: s.doStep(0, 1), "fmi3DoStep", "Instantiated")
    importer3.refused(lambda: s.exitInitializationMode(), "fmi3ExitInitializationMode", "Instantiated")
    importer3.refused(lambda: s.terminate(), "fmi3Terminate", "Instantiated")
    importer3.refused(lambda: s.enterInitializationMode(startTime=math.nan), "startTime is nan")
    importer3.refused(lambda: s.enterInitializationMode(stopTime=-1.0), "stopTime is -1", "at least startTime, 0")
    importer3.refused(lambda: s.enterInitializationMode(tolerance=0.0), "tolerance is 0")
    importer3.initialise(stopTime=2.5)
    importer3.refused(lambda: s.enterInitializationMode(), "Step Mode")
    importer3.refused(lambda: s.enterEventMode(), "fmi3EnterEventMode", "Step Mode")
    importer3.refused(lambda: s.enterStepMode(), "hasEventMode")
    importer3.refused(lambda: s.updateDiscreteStates(), "Step Mode")
    importer3.refused(lambda: importer3.set("orbit.raan", 1.0), "orbit.raan", "fixed after initialization")
    s.doStep(0, 2.5)
    importer3.refused(lambda: s.doStep(2.5, 0.5), "ends at 3", "stop time, 2.5")
    s.terminate()
    importer3.refused(lambda: s.doStep(2.5, 1), "Terminated")
    importer3.refused(lambda: importer3.set("target.torque", [0.0] * 3), "Terminated")
    assert importer3.get("target.position").shape == (3,)
    s.reset()
    importer3.initialise()
    s.doStep(0, 3.0)


def test_wrong_counts_references_types_and_pointers(importer3):
    s = importer3.fmu
    importer3.initialise()
    position = importer3.of("target.position")
    importer3.refused(lambda: s.getFloat64(position, 2), "found room for 2 values, expected 3")
    importer3.refused(lambda: s.setFloat64(importer3.of("target.torque"), [1.0] * 4), "for 4 values, expected 3")
    importer3.refused(lambda: s.getFloat64([10_000]), "value reference 10000", "expected one below")
    gravity = importer3.references["gravityGradient"]
    importer3.refused(lambda: s.getFloat64([gravity]), "gravityGradient is a Boolean")
    importer3.refused(lambda: s.getBoolean([importer3.references["orbit.raan"]]), "orbit.raan is a Float64")
    importer3.refused(lambda: s.fmi3GetFloat64(s.component, None, 3, None, 3), "null pointer", "3 variables")
    importer3.refused(lambda: importer3.set("target.torque", [0.0, math.nan, 0.0]), "target.torque[2] is nan")
    points = np.zeros((12, 3))
    points[4, 1] = np.inf
    importer3.fmu.reset()
    importer3.refused(lambda: importer3.set("target.features", points), "target.features[5,2] is inf")
    importer3.initialise()
    place, number = fmi3Boolean(), fmi3Float64()
    flag, last = ctypes.byref(place), ctypes.byref(number)
    for missing in range(4):
        answers = [None if k == missing else answer for k, answer in enumerate((flag, flag, flag, last))]
        importer3.refused(
            lambda a=answers: s.fmi3DoStep(s.component, 0.0, 1.0, False, *a), "null pointer", "earlyReturn"
        )
    assert importer3.get("target.torque").tolist() == [0.0, 0.0, 0.0]
    s.doStep(0, 1)


OTHER_TYPES = ["Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "String"]


def test_there_are_no_variables_of_other_types(importer3):
    s = importer3.fmu
    importer3.initialise()
    for name in OTHER_TYPES:
        get, put, one = getattr(s, f"get{name}"), getattr(s, f"set{name}"), ["x"] if name == "String" else [1]
        importer3.refused(lambda get=get: get([0]), f"no {name} variables")
        importer3.refused(lambda put=put, one=one: put([0], one), f"no {name} variables")
        assert get([]) == []
    importer3.refused(lambda: s.getBinary([0]), "no Binary variables")
    importer3.refused(lambda: s.setBinary([0], [b"x"]), "no Binary variables")
    importer3.refused(lambda: s.getClock([0]), "no Clock variables")


def test_undeclared_functions_are_refused(importer3):
    s = importer3.fmu
    importer3.initialise()
    importer3.refused(lambda: s.enterConfigurationMode(), "no structural parameters")
    importer3.refused(lambda: s.exitConfigurationMode(), "no structural parameters")
    importer3.refused(lambda: s.fmi3EvaluateDiscreteStates(s.component), "providesEvaluateDiscreteStates")
    importer3.refused(lambda: s.fmi3ActivateModelPartition(s.component, 0, 0.0), "Scheduled Execution")
    count = ctypes.byref(ctypes.c_size_t())
    importer3.refused(lambda: s.fmi3GetNumberOfContinuousStates(s.component, count), "Model Exchange")
    importer3.refused(lambda: s.fmi3GetNumberOfVariableDependencies(s.component, 0, count), "providesPerElement")
    importer3.refused(
        lambda: s.fmi3GetVariableDependencies(s.component, 0, None, None, None, None, 0), "providesPerElement"
    )
    s.doStep(0, 1)


def test_every_function_survives_a_null_instance_and_null_arrays(importer3):
    """All functions of the standard, as fmpy declares them, with nothing but zeros and null pointers."""
    s = importer3.fmu
    functions = [name for name in dir(s) if name.startswith("fmi3") and "Instantiate" not in name]
    assert len(functions) == 72
    nothing = {ctypes.c_uint: 0, ctypes.c_size_t: 0, ctypes.c_double: 0.0, ctypes.c_bool: False}
    for name in functions:
        function = getattr(s.dll, name)
        blank = [nothing.get(kind) for kind in function.argtypes]
        status = function(*blank)
        assert name in ("fmi3GetVersion", "fmi3FreeInstance") or status == 3
        if name not in ("fmi3GetVersion", "fmi3FreeInstance", "fmi3Reset"):
            assert function(s.component, *blank[1:]) in (0, 3)
    importer3.fmu.reset()
    importer3.initialise()
    importer3.step(0, 1)


def test_impossible_instantiations_are_refused(importer3):
    s = importer3.fmu
    common = (False, False)
    none = (None, 0, None, s.logMessage, s.intermediateUpdate)
    token = s.guid.encode()
    create = s.fmi3InstantiateCoSimulation
    assert not create(b"", token, None, *common, False, False, *none)
    assert "name is empty" in importer3.messages[-1]
    assert not create(b"x", b"{other}", None, *common, False, False, *none)
    assert "different builds" in importer3.messages[-1]
    assert not create(b"x", token, None, *common, True, False, *none)
    assert "eventModeUsed is true, expected false" in importer3.messages[-1]
    blank = [kind() for kind in s.dll.fmi3InstantiateScheduledExecution.argtypes[7:]]
    assert not s.fmi3InstantiateScheduledExecution(b"x", token, b"", *common, None, s.logMessage, *blank)
    assert "Scheduled Execution was asked for" in importer3.messages[-1]
    other = create(b"y", token, None, *common, False, True, *none)
    s.fmi3FreeInstance(other)


def test_logging_categories_select_the_messages(importer3):
    s = importer3.fmu
    importer3.refused(lambda: s.setDebugLogging(True, ["logAll"]), "logAll", "logStatusError")
    s.setDebugLogging(False, ["logStatusError"])
    heard = len(importer3.messages)
    with pytest.raises(FMICallException):
        s.doStep(0, 1)
    assert len(importer3.messages) == heard
    s.setDebugLogging(True, ["logEvents"])
    importer3.initialise()
    assert importer3.messages[heard:] == ["initialised at 0 s, tolerance 1e-13"]
