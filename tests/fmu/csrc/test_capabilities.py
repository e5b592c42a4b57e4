"""Declared capabilities beyond stepping: saved states, derivatives, tunable parameters, Model Exchange."""

import ctypes
import subprocess
import sys
import threading
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.integrate import solve_ivp

import oracles
from baryscope.fmu import Session, build_fmu
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from importer import Importer


@pytest.fixture
def importer(envisat_fmu, tmp_path):
    importer = Importer(envisat_fmu, tmp_path)
    yield importer
    importer.fmu.freeInstance()


def outputs_of(importer):
    return importer.fmu.getReal([r for name, r in importer.references.items() if name.startswith(("features", "der("))])


def references_of(importer, *kinds):
    """Value references of the scalars of some kinds, Booleans left out."""
    table = tumbling_target(12).variables
    kinds_of_scalars = [(v.kind, v.boolean) for v in table for _ in range(v.size)]
    return [index for index, (kind, boolean) in enumerate(kinds_of_scalars) if kind in kinds and not boolean]


# ---- saved states ----


def test_a_restored_state_continues_bitwise(importer):
    s = importer.fmu
    torque = [importer.references[f"target.torque[{i}]"] for i in (1, 2, 3)]
    importer.initialise()
    for k in range(7):
        s.doStep(k * 0.3, 0.3)
    state = s.getFMUstate()
    s.setReal(torque, [5.0, 0.0, 0.0])
    before = []
    for k in range(7, 30):
        s.doStep(k * 0.3, 0.3)
        before.append(outputs_of(importer))
    for _ in range(2):
        s.setFMUstate(state)
        assert s.getReal(torque) == [0.0, 0.0, 0.0]
        s.setReal(torque, [5.0, 0.0, 0.0])
        after = []
        for k in range(7, 30):
            s.doStep(k * 0.3, 0.3)
            after.append(outputs_of(importer))
        assert after == before
    s.freeFMUstate(state)


def test_a_state_survives_a_reset_and_knows_its_mode(importer):
    s = importer.fmu
    importer.initialise()
    s.doStep(0, 5.0)
    state, expected = s.getFMUstate(), outputs_of(importer)
    s.reset()
    s.setFMUstate(state)
    assert outputs_of(importer) == expected
    s.doStep(5.0, 1.0)
    s.freeFMUstate(state)


def test_a_serialised_state_continues_bitwise_in_another_process(importer, envisat_fmu, tmp_path):
    s = importer.fmu
    importer.initialise()
    for k in range(5):
        s.doStep(k * 0.7, 0.7)
    state = s.getFMUstate()
    saved = tmp_path / "state.bin"
    saved.write_bytes(bytes(s.serializeFMUstate(state)))
    s.freeFMUstate(state)
    for k in range(5, 20):
        s.doStep(k * 0.7, 0.7)
    program = (
        "import sys; sys.path[:0] = [sys.argv[4]]\n"
        "from pathlib import Path; from importer import Importer\n"
        "i = Importer(sys.argv[1], sys.argv[2]); i.initialise()\n"
        "state = i.fmu.deSerializeFMUstate(Path(sys.argv[3]).read_bytes())\n"
        "i.fmu.setFMUstate(state)\n"
        "for k in range(5, 20): i.fmu.doStep(k * 0.7, 0.7)\n"
        "outputs = range(i.references['features[1,1]'], i.references['state.attitude[1]'])\n"
        "print([v.hex() for v in i.fmu.getReal(list(outputs))])"
    )
    arguments = [str(envisat_fmu), str(tmp_path / "other"), str(saved), str(Path(__file__).parents[2])]
    result = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True)
    here = s.getReal(list(range(importer.references["features[1,1]"], importer.references["state.attitude[1]"])))
    assert result.stdout.strip() == str([value.hex() for value in here])


@pytest.mark.parametrize("place", [0, 10, 100, 999_999])
def test_damaged_states_are_refused(importer, place):
    s = importer.fmu
    importer.initialise()
    state = s.getFMUstate()
    good = bytes(s.serializeFMUstate(state))
    place = min(place, len(good) - 1)
    bad = good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :]
    importer.refused(lambda: s.deSerializeFMUstate(bad), "fmi2DeSerializeFMUstate: the state is")
    importer.refused(lambda: s.deSerializeFMUstate(good[:-1]), f"found {len(good) - 1} bytes, expected {len(good)}")
    importer.refused(lambda: s.setFMUstate(ctypes.c_void_p()), "null pointer")
    s.freeFMUstate(state)
    s.doStep(0, 1)


def test_states_of_another_build_are_refused(importer, envisat, tmp_path):
    run = envisat.run.model_copy(update={"tolerance": 1e-10})
    other = Importer(build_fmu(envisat.model_copy(update={"run": run}), tmp_path / "o.fmu"), tmp_path / "o")
    other.initialise()
    state = other.fmu.getFMUstate()
    foreign = bytes(other.fmu.serializeFMUstate(state))
    importer.refused(lambda: importer.fmu.deSerializeFMUstate(foreign), "another build")
    importer.refused(lambda: importer.fmu.setFMUstate(state), "another build")
    other.fmu.freeFMUstate(state)
    other.fmu.freeInstance()


# ---- derivatives ----


def perturbed(importer, change, unknowns):
    """The unknowns after `change()` from a saved state, which is then restored."""
    s = importer.fmu
    state = s.getFMUstate()
    change()
    values = np.array(s.getReal(unknowns))
    s.setFMUstate(state)
    s.freeFMUstate(state)
    return values


def test_directional_derivatives_at_the_start_are_exact(importer, envisat):
    """Against CasADi's own Jacobian of the same functions, and against central differences through the unit."""
    s = importer.fmu
    s.setupExperiment()
    s.enterInitializationMode()
    parameters = references_of(importer, Kind.PARAMETER)
    unknowns = references_of(importer, Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE)
    rng = np.random.default_rng(3)
    scale = np.abs(s.getReal(parameters)) + 1e-3
    scale[-1] = 0.0  # the tolerance changes nothing
    seed = rng.normal(size=len(parameters)) * scale
    found = np.array(s.getDirectionalDerivative(unknowns, parameters, list(seed)))

    p = ca.SX.sym("p", envisat.flat_parameters().size)
    system = tumbling_target(12)
    x0 = system.initial(p)
    first = ca.vertcat(system.outputs(x0, p), x0, system.rhs(x0, ca.DM.zeros(6), p))
    full = np.insert(seed, -1, 0.0)  # the Boolean
    exact = np.array(ca.Function("j", [p], [ca.jtimes(first, p, full)])(envisat.flat_parameters())).ravel()
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())

    start, h = np.array(s.getReal(parameters)), 1e-5
    ahead, behind = (
        perturbed(importer, lambda sign=sign: s.setReal(parameters, list(start + sign * h * seed)), unknowns)
        for sign in (1, -1)
    )
    # A seed of the size of the parameters leaves the quaternion's length free: unit length is checked to 1e-3.
    np.testing.assert_allclose((ahead - behind) / (2 * h), found, rtol=1e-4, atol=1e-5 * np.abs(found).max())


def test_directional_derivatives_in_a_run(importer, envisat):
    s = importer.fmu
    importer.initialise()
    s.doStep(0, 12.5)
    knowns = references_of(importer, Kind.INPUT, Kind.STATE)
    unknowns = references_of(importer, Kind.OUTPUT, Kind.DERIVATIVE)
    seed = np.random.default_rng(4).normal(size=len(knowns))
    found = np.array(s.getDirectionalDerivative(unknowns, knowns, list(seed)))
    x, u, p = (ca.SX.sym(name, n) for name, n in (("x", 14), ("u", 6), ("p", envisat.flat_parameters().size)))
    system = tumbling_target(12)
    run = ca.vertcat(system.outputs(x, p), system.rhs(x, u, p))
    jtimes = ca.Function("j", [x, u, p], [ca.jtimes(run, ca.vertcat(u, x), seed)])
    exact = np.array(jtimes(s.getReal(references_of(importer, Kind.STATE)), np.zeros(6), envisat.flat_parameters()))
    np.testing.assert_allclose(found, exact.ravel(), rtol=1e-11, atol=1e-13)


def test_derivatives_of_wrong_variables_are_refused(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    feature, rate = reference["features[1,1]"], reference["der(state.velocity[1])"]
    importer.refused(lambda: s.getDirectionalDerivative([feature], [reference["orbit.raan"]], [1.0]),
                     "found orbit.raan, expected an input, a tunable parameter or a state")  # fmt: skip
    importer.refused(lambda: s.getDirectionalDerivative([reference["state.velocity[1]"]], [0], [1.0]),
                     "found state.velocity[1], expected an output or a derivative")  # fmt: skip
    importer.refused(lambda: s.getDirectionalDerivative([feature], [9999], [1.0]), "9999")
    assert s.getDirectionalDerivative([rate], [0], [2.0]) == [2.0]


def test_output_derivatives_are_the_velocities(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    s.doStep(0, 100.0)
    position = [reference[f"target.position[{i}]"] for i in (1, 2, 3)]
    velocity = [reference[f"target.velocity[{i}]"] for i in (1, 2, 3)]
    np.testing.assert_allclose(s.getRealOutputDerivatives(position, [1] * 3), s.getReal(velocity), rtol=1e-12)
    importer.refused(lambda: s.getRealOutputDerivatives(position, [2] * 3), "order 2, expected 1")
    importer.refused(lambda: s.getRealOutputDerivatives([0], [1]), "chaser.acceleration[1], expected an output")


def test_derivatives_are_those_of_the_model(importer, envisat):
    s = importer.fmu
    importer.initialise()
    s.doStep(0, 30.0)
    s.setReal([0, 4], [1e-3, 7.0])
    x = s.getReal(references_of(importer, Kind.STATE))
    expected = tumbling_target(12).rhs(x, [1e-3, 0, 0, 0, 7.0, 0], envisat.flat_parameters())
    np.testing.assert_allclose(
        s.getReal(references_of(importer, Kind.DERIVATIVE)), np.array(expected).ravel(), rtol=1e-12
    )


# ---- tunable parameters ----


def test_tuning_during_a_run(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    s.doStep(0, 10.0)
    point = [reference[f"target.features[1,{i}]"] for i in (1, 2, 3)]
    seen = [reference[f"features[1,{i}]"] for i in (1, 2, 3)]
    com = np.array(s.getReal([reference[f"target.position[{i}]"] for i in (1, 2, 3)]))
    arm = np.array(s.getReal(seen)) - com
    s.setReal(point, [2 * c for c in s.getReal(point)])
    np.testing.assert_allclose(np.array(s.getReal(seen)) - com, 2 * arm, rtol=1e-12)

    before = s.getReal([reference["target.rotationalEnergy"]])
    s.doStep(10.0, 50.0)
    assert s.getReal([reference["target.rotationalEnergy"]]) == pytest.approx(before, rel=1e-12)
    s.setBoolean([reference["gravityGradient"]], [1])
    s.doStep(60.0, 50.0)
    assert s.getReal([reference["target.rotationalEnergy"]]) != pytest.approx(before, rel=1e-9)


def test_impossible_tuning_is_refused_and_undone(importer):
    s, reference = importer.fmu, importer.references
    importer.initialise()
    s.doStep(0, 10.0)
    before = outputs_of(importer)
    tolerance = reference["solver.tolerance"]
    importer.refused(lambda: s.setReal([tolerance], [0.0]), "solver.tolerance", "1e-15")
    assert s.getReal([tolerance]) == [1e-13]
    line = [r for name, r in reference.items() if name.startswith("target.features[")]
    importer.refused(lambda: s.setReal(line, [float(k) for k in range(len(line))]), "target.features", "line")
    assert outputs_of(importer) == before
    s.doStep(10.0, 1.0)


# ---- Model Exchange ----


def array(values):
    return np.ascontiguousarray(values, dtype=float)


def pointer(values):
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def test_model_exchange_integrated_by_scipy(model, envisat):
    """The importer's integrator on the unit's derivatives, against the difference of two Kepler orbits."""
    m = model.fmu
    model.initialise()
    m.newDiscreteStates()
    m.enterContinuousTimeMode()
    states, rates = np.empty(14), np.empty(14)
    m.getContinuousStates(pointer(states), 14)

    def derivative(time, x):
        values = array(x)
        m.setTime(time)
        m.setContinuousStates(pointer(values), 14)
        m.getDerivatives(pointer(rates), 14)
        return rates.copy()

    solution = solve_ivp(derivative, (0, 600), states.copy(), "DOP853", rtol=1e-12, atol=1e-12)
    m.setContinuousStates(pointer(array(solution.y[:, -1])), 14)
    position = m.getReal([model.references[f"target.position[{i}]"] for i in (1, 2, 3)])
    np.testing.assert_allclose(position, oracles.com_in_chaser_frame(envisat, [600.0])[0], atol=1e-6)
    attitude = m.getReal([model.references[f"target.attitude[{i}]"] for i in (1, 2, 3, 4)])
    expected = oracles.torque_free_attitude(envisat, [0.0, 600.0])[-1]
    assert oracles.angle_between(attitude, expected) < 1e-8


def test_model_exchange_by_fmpy_agrees_with_co_simulation(envisat_fmu):
    arguments = {"stop_time": 100.0, "output_interval": 10.0, "output": ["target.position[1]"]}
    results = [
        fmpy.simulate_fmu(str(envisat_fmu), fmi_type=kind, relative_tolerance=1e-10, **arguments)
        for kind in ("ModelExchange", "CoSimulation")
    ]
    np.testing.assert_allclose(*(r["target.position[1]"] for r in results), atol=1e-5)


def test_model_exchange_calls_at_the_wrong_time(model):
    m = model.fmu
    values = array(np.ones(14))
    model.refused(lambda: m.setContinuousStates(pointer(values), 14), "Instantiated")
    model.initialise()
    model.refused(lambda: m.setContinuousStates(pointer(values), 14), "Event Mode")
    model.refused(lambda: m.completedIntegratorStep(), "Event Mode")
    m.enterContinuousTimeMode()
    model.refused(lambda: m.enterContinuousTimeMode(), "Continuous-Time Mode")
    model.refused(lambda: m.setContinuousStates(pointer(values), 13), "found 13 values, expected 14")
    model.refused(lambda: m.setContinuousStates(pointer(array([np.nan] * 14)), 14), "state 1 is nan")
    model.refused(lambda: m.setTime(np.inf), "time is inf")
    model.refused(lambda: m.getEventIndicators(pointer(values), 2), "found 2 values, expected 0")
    model.refused(lambda: m.setReal([model.references["solver.tolerance"]], [1e-9]), "Event Mode only")
    m.enterEventMode()
    m.setReal([model.references["state.velocity[2]"]], [0.25])
    m.enterContinuousTimeMode()
    m.getContinuousStates(pointer(values), 14)
    assert values[12] == 0.25
    m.getNominalsOfContinuousStates(pointer(values), 14)
    assert np.all(values > 0)


def test_a_co_simulation_state_is_no_model_exchange_state(importer, model):
    importer.initialise()
    state = importer.fmu.getFMUstate()
    model.refused(lambda: model.fmu.setFMUstate(state), "other interface")
    importer.fmu.freeFMUstate(state)


# ---- several instances ----


def test_instances_in_threads_compute_what_they_compute_alone(envisat_fmu):
    def run(torque):
        with Session(envisat_fmu) as session:
            for _ in range(300):
                session.step(0.7, torque=[torque, 0.0, 0.0])
            return session.outputs.copy()

    expected = [run(float(torque)) for torque in range(6)]
    found = {}
    threads = [threading.Thread(target=lambda t=t: found.update({t: run(float(t))})) for t in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for torque in range(6):
        assert np.array_equal(found[torque], expected[torque])


def test_a_pointer_to_no_instance_is_refused(importer):
    junk = ctypes.create_string_buffer(4096)
    with pytest.raises(FMICallException):
        importer.fmu.fmi2Terminate(ctypes.cast(junk, ctypes.c_void_p))


def test_the_smallest_unit_has_three_features(small_fmu):
    with Session(small_fmu) as session:
        session.step(1.0)
        assert session.features.shape == (3, 3)
