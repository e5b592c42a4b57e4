"""Illegal calls, made as an importer would make them: each is refused with a reason and changes nothing."""

import ctypes
import math

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

from importer import DISCARD, Importer


@pytest.fixture
def importer(envisat_fmu, tmp_path):
    importer = Importer(envisat_fmu, tmp_path)
    yield importer
    importer.fmu.freeInstance()


def test_calls_before_initialization(importer):
    s = importer.fmu
    importer.refused(lambda: s.doStep(0, 1), "fmi2DoStep", "Instantiated")
    importer.refused(lambda: s.getReal([0]), "fmi2GetReal", "Instantiated")
    importer.refused(lambda: s.exitInitializationMode(), "fmi2ExitInitializationMode", "Instantiated")
    importer.refused(lambda: s.terminate(), "fmi2Terminate", "Instantiated")
    importer.refused(lambda: s.getRealStatus(2), "fmi2GetRealStatus", "Instantiated")
    importer.initialise()
    s.doStep(0, 1)


def test_calls_after_termination(importer):
    s = importer.fmu
    importer.initialise()
    s.doStep(0, 2.5)
    s.terminate()
    importer.refused(lambda: s.doStep(2.5, 1), "fmi2DoStep", "Terminated")
    importer.refused(lambda: s.setReal([0], [1.0]), "fmi2SetReal", "Terminated")
    importer.refused(lambda: s.setupExperiment(), "fmi2SetupExperiment", "Terminated")
    assert s.getReal([importer.references["target.position[1]"]])
    assert s.getRealStatus(2) == 2.5
    s.reset()
    importer.initialise()
    s.doStep(0, 1)


def test_initialization_twice_or_with_a_wrong_experiment(importer):
    s = importer.fmu
    importer.refused(lambda: s.setupExperiment(startTime=math.nan), "startTime", "finite")
    importer.refused(lambda: s.setupExperiment(startTime=1.0, stopTime=0.0), "stopTime is 0", "at least startTime, 1")
    importer.refused(lambda: s.setupExperiment(tolerance=-1.0), "tolerance is -1")
    s.setupExperiment()
    s.enterInitializationMode()
    importer.refused(lambda: s.enterInitializationMode(), "Initialization Mode")
    importer.refused(lambda: s.setupExperiment(), "Initialization Mode")


def test_parameters_are_fixed_after_initialization(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    importer.refused(lambda: s.setReal([reference["orbit.raan"]], [1.0]), "orbit.raan", "fixed after initialization")
    importer.refused(lambda: s.setReal([reference["state.velocity[1]"]], [1.0]), "state.velocity[1] is a state")
    importer.refused(lambda: s.setReal([reference["features[1,1]"]], [1.0]), "features[1,1]", "calculated")


def test_values_are_all_checked_before_any_is_set(importer):
    s, reference = importer.fmu, importer.references
    pair = [reference["orbit.raan"], reference["orbit.inclination"]]
    importer.refused(lambda: s.setReal(pair, [0.5, math.inf]), "orbit.inclination is inf")
    s.setupExperiment()
    s.enterInitializationMode()
    assert s.getReal(pair)[0] != 0.5


def test_wrong_references_types_and_pointers(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    importer.refused(lambda: s.getReal([10_000]), "value reference 10000", "expected one below")
    importer.refused(lambda: s.getReal([reference["gravityGradient"]]), "gravityGradient is a Boolean")
    importer.refused(lambda: s.getBoolean([reference["orbit.raan"]]), "orbit.raan is a Real")
    importer.refused(lambda: s.getInteger([0]), "no Integer variables")
    importer.refused(lambda: s.setString([0], ["x"]), "no String variables")
    importer.refused(lambda: s.fmi2GetReal(s.component, None, 3, None), "null pointer", "3 variables")
    assert s.getInteger([]) == []
    assert s.getReal([]) == []


def test_a_null_instance_gives_an_error(importer):
    for call in (importer.fmu.fmi2Reset, importer.fmu.fmi2Terminate):
        with pytest.raises(FMICallException):
            call(ctypes.c_void_p())
    importer.fmu.fmi2FreeInstance(ctypes.c_void_p())


def test_initial_outputs_follow_the_parameters(importer):
    s, reference = importer.fmu, importer.references
    name = reference["chaser.position[1]"]
    s.setupExperiment()
    s.enterInitializationMode()
    s.getReal([name])
    s.setReal([reference["chaser.position0[1]"]], [12.5])
    assert s.getReal([name]) == [12.5]
    s.setReal([reference["orbit.eccentricity"]], [1.5])
    importer.refused(lambda: s.getReal([name]), "orbit.eccentricity", "0 ≤ e < 1")
    importer.refused(lambda: s.exitInitializationMode(), "orbit.eccentricity", "0 ≤ e < 1")
    s.setReal([reference["orbit.eccentricity"]], [0.5])
    s.exitInitializationMode()


def test_the_communication_point_must_be_where_the_unit_is(importer):
    s = importer.fmu
    importer.initialise()
    s.doStep(0, 1)
    importer.refused(lambda: s.doStep(5.0, 1.0), "currentCommunicationPoint is 5", "expected 1")
    importer.refused(lambda: s.doStep(math.nan, 1.0), "currentCommunicationPoint is nan")
    importer.refused(lambda: s.doStep(1.0, 1e-20), "too small to move the time 1")
    s.doStep(1.0 + 1e-12, 1.0)
    assert s.getRealStatus(2) == 2.0 + 1e-12


def test_undeclared_functions_are_refused(importer):
    s = importer.fmu
    importer.initialise()
    importer.refused(lambda: s.cancelStep(), "fmi2CancelStep")
    importer.refused(lambda: s.getIntegerStatus(1), status=DISCARD)
    assert s.getBooleanStatus(3) == 0


def test_instantiation_for_another_build(importer):
    s = importer.fmu
    callbacks = ctypes.byref(importer.callbacks)
    for name, token, words in ((b"", s.guid.encode(), "name is empty"), (b"x", b"{other}", "different builds")):
        assert not s.fmi2Instantiate(name, 1, token, b"", callbacks, 0, 0)
        assert words in importer.messages[-1]


def test_logging_categories_select_the_messages(importer):
    s = importer.fmu
    importer.refused(lambda: s.setDebugLogging(True, ["logAll"]), "logAll", "logStatusError")
    s.setDebugLogging(False, ["logStatusError"])
    heard = len(importer.messages)
    with pytest.raises(FMICallException):
        s.doStep(0, 1)
    assert len(importer.messages) == heard
    s.setDebugLogging(True, ["logEvents"])
    importer.initialise()
    assert importer.messages[heard:] == ["initialised at 0 s, tolerance 1e-13"]
    s.setDebugLogging(False, [])
    s.reset()
    assert len(importer.messages) == heard + 1
    s.setDebugLogging(True, [])
    importer.refused(lambda: s.doStep(0, 1), "Instantiated")


def test_a_long_instance_name_and_percent_signs_are_harmless(importer):
    s = importer.fmu
    component = s.fmi2Instantiate(b"%n%s" * 100, 1, s.guid.encode(), b"", ctypes.byref(importer.callbacks), 0, 0)
    with pytest.raises(FMICallException):
        s.fmi2Terminate(component)
    assert "fmi2Terminate" in importer.messages[-1]
    s.fmi2FreeInstance(component)


def test_the_logger_gets_the_whole_name_and_whole_characters(importer):
    """An importer knows its instances by their names, however deep in a system: 127 bytes of one were passed on."""
    s, heard = importer.fmu, []
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: heard.append((a[1], a[4])))
    name = "système.".encode() * 40
    component = s.fmi2Instantiate(name, 1, s.guid.encode(), b"", ctypes.byref(callbacks), 0, 0)
    for letters in range(4):  # so that the message is cut off at each place within a character
        category = ctypes.c_char_p(("x" * letters + "𝄞" * 300).encode())
        with pytest.raises(FMICallException):
            s.fmi2SetDebugLogging(component, 1, 1, (ctypes.c_char_p * 1)(category))
    s.fmi2FreeInstance(component)
    assert [one for one, _ in heard] == [name] * 4
    assert all(message.decode().endswith("𝄞") for _, message in heard)
