"""Capabilities of the FMI 3.0 unit beyond stepping: derivatives both ways, saved states, Model Exchange."""

import ctypes
import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import oracles
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from importer import Importer


def array(values):
    return np.ascontiguousarray(values, dtype=float)


def pointer(values):
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


# ---- derivatives ----


TUNABLE = ["target.features", "target.normals", "solver.tolerance"]


def jacobian_in_a_run(importer3, envisat):
    """CasADi's Jacobian of (outputs, derivatives) by (inputs, tunable Reals, states) where the importer is."""
    x, u, p = (ca.SX.sym(name, n) for name, n in (("x", 14), ("u", 6), ("p", envisat.flat_parameters().size)))
    system = tumbling_target(12)
    run = ca.vertcat(system.outputs(x, p), system.rhs(x, u, p))
    scalars = [v.name for v in system.of_kind(Kind.PARAMETER) for _ in range(v.size)]
    tuned = p[[place for place, name in enumerate(scalars) if name in TUNABLE]]
    function = ca.Function("j", [x, u, p], [ca.jacobian(run, ca.vertcat(u, tuned, x))])
    states = importer3.get(*importer3.of_kinds(Kind.STATE))
    return np.array(function(states, importer3.get(*importer3.of_kinds(Kind.INPUT)), envisat.flat_parameters()))


def test_derivatives_in_a_run_are_exact_both_ways(importer3, envisat):
    s = importer3.fmu
    importer3.initialise()
    importer3.step(0, 12.5)
    knowns = [*importer3.of_kinds(Kind.INPUT), *TUNABLE, *importer3.of_kinds(Kind.STATE)]
    unknowns = importer3.of_kinds(Kind.OUTPUT, Kind.DERIVATIVE)
    columns, rows = importer3.size(*knowns), importer3.size(*unknowns)
    jacobian = jacobian_in_a_run(importer3, envisat)
    rng = np.random.default_rng(4)
    v, w = rng.normal(size=columns), rng.normal(size=rows)
    forward = np.array(s.getDirectionalDerivative(importer3.of(*unknowns), importer3.of(*knowns), v.tolist(), rows))
    reverse = np.array(s.getAdjointDerivative(importer3.of(*unknowns), importer3.of(*knowns), w.tolist(), columns))
    np.testing.assert_allclose(forward, jacobian @ v, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(reverse, w @ jacobian, rtol=1e-11, atol=1e-11)
    assert w @ forward == pytest.approx(reverse @ v, rel=1e-12)


def test_derivatives_at_the_start_are_exact_both_ways(importer3, envisat):
    s = importer3.fmu
    s.enterInitializationMode()
    knowns = importer3.of_kinds(Kind.PARAMETER)
    unknowns = importer3.of_kinds(Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE)
    columns, rows = importer3.size(*knowns), importer3.size(*unknowns)
    rng = np.random.default_rng(5)
    scale = np.abs(importer3.get(*knowns)) + 1e-3
    v, w = rng.normal(size=columns) * scale, rng.normal(size=rows)
    forward = np.array(s.getDirectionalDerivative(importer3.of(*unknowns), importer3.of(*knowns), v.tolist(), rows))
    reverse = np.array(s.getAdjointDerivative(importer3.of(*unknowns), importer3.of(*knowns), w.tolist(), columns))

    p = ca.SX.sym("p", envisat.flat_parameters().size)
    system = tumbling_target(12)
    x0 = system.initial(p)
    first = ca.vertcat(system.outputs(x0, p), x0, system.rhs(x0, ca.DM.zeros(6), p))
    full = np.array(ca.Function("j", [p], [ca.jacobian(first, p)])(envisat.flat_parameters()))
    jacobian = np.delete(full, -2, axis=1)  # the Boolean
    np.testing.assert_allclose(forward, jacobian @ v, rtol=1e-11, atol=1e-12 * np.abs(forward).max())
    np.testing.assert_allclose(reverse, w @ jacobian, rtol=1e-11, atol=1e-12 * np.abs(reverse).max())
    assert w @ forward == pytest.approx(reverse @ v, rel=1e-12)


def test_derivatives_of_wrong_variables_are_refused(importer3):
    s = importer3.fmu
    importer3.initialise()
    feature, torque = importer3.of("target.position"), importer3.of("target.torque")
    raan, words = importer3.of("orbit.raan"), "found orbit.raan, expected an input, a tunable parameter or a state"
    importer3.refused(lambda: s.getDirectionalDerivative(feature, raan, [1.0], 3), words)
    importer3.refused(lambda: s.getAdjointDerivative(feature, raan, [1.0] * 3, 1), words)
    importer3.refused(
        lambda: s.getDirectionalDerivative(feature, torque, [1.0] * 2, 3), "room for 2 values, expected 3"
    )
    importer3.refused(lambda: s.getAdjointDerivative(feature, torque, [1.0] * 3, 2), "room for 2 values, expected 3")
    time = [importer3.references["time"]]
    importer3.refused(lambda: s.getDirectionalDerivative(feature, time, [1.0], 3), "found time, expected an input")


def test_output_derivatives_are_the_velocities(importer3):
    importer3.initialise()
    importer3.step(0, 100.0)
    references = importer3.of("target.position")
    values = array(np.empty(3))

    def derivatives(order):
        orders = (ctypes.c_int32 * len(references))(*[order] * len(references))
        numbers = (ctypes.c_uint * len(references))(*references)
        importer3.fmu.fmi3GetOutputDerivatives(
            importer3.fmu.component, numbers, len(references), orders, pointer(values), 3
        )

    derivatives(1)
    np.testing.assert_allclose(values, importer3.get("target.velocity"), rtol=1e-12)
    importer3.refused(lambda: derivatives(2), "order 2, expected 1")


# ---- saved states ----


def test_a_restored_state_continues_bitwise(importer3):
    s = importer3.fmu
    outputs = importer3.of_kinds(Kind.OUTPUT, Kind.DERIVATIVE)
    importer3.initialise()
    for k in range(7):
        importer3.step(k * 0.3, 0.3)
    state = s.getFMUState()
    content = s.serializeFMUState(state)

    def run():
        importer3.set("target.torque", [5.0, 0.0, 0.0])
        found = []
        for k in range(7, 30):
            importer3.step(k * 0.3, 0.3)
            found.append(importer3.get(*outputs).tolist())
        return found

    expected = run()
    s.setFMUState(state)
    assert importer3.get("target.torque").tolist() == [0.0, 0.0, 0.0]
    assert run() == expected
    s.reset()
    again = s.deserializeFMUState(content)
    s.setFMUState(again)
    assert run() == expected
    for one in (state, again):
        s.freeFMUState(one)
    importer3.refused(lambda: s.deserializeFMUState(content[:-1]), f"expected {len(content)}")
    importer3.refused(lambda: s.deserializeFMUState(content[:-1] + bytes([content[-1] ^ 1])), "is damaged")


def test_a_state_of_the_fmi_2_unit_is_refused(importer3, envisat_fmu, tmp_path):
    two = Importer(envisat_fmu, tmp_path / "two")
    two.initialise()
    state = two.fmu.getFMUstate()
    foreign = bytes(two.fmu.serializeFMUstate(state))
    importer3.refused(lambda: importer3.fmu.deserializeFMUState(foreign), "another build")
    two.fmu.freeFMUstate(state)
    two.fmu.freeInstance()


# ---- Model Exchange ----


def test_model_exchange_integrated_by_scipy(model3, envisat):
    """The importer's integrator on the unit's derivatives, against the difference of two Kepler orbits."""
    m = model3.fmu
    model3.initialise()
    assert m.updateDiscreteStates() == (False, False, False, False, False, 0.0)
    m.enterContinuousTimeMode()
    states, rates = np.empty(14), np.empty(14)
    m.getContinuousStates(pointer(states), 14)

    def derivative(time, x):
        values = array(x)
        m.setTime(time)
        m.setContinuousStates(pointer(values), 14)
        m.getContinuousStateDerivatives(pointer(rates), 14)
        return rates.copy()

    solution = solve_ivp(derivative, (0, 600), states.copy(), "DOP853", rtol=1e-12, atol=1e-12)
    m.setContinuousStates(pointer(array(solution.y[:, -1])), 14)
    assert m.completedIntegratorStep() == (False, False)
    position, attitude = model3.get("target.position"), model3.get("target.attitude")
    np.testing.assert_allclose(position, oracles.com_in_chaser_frame(envisat, [600.0])[0], atol=1e-6)
    assert oracles.angle_between(attitude, oracles.torque_free_attitude(envisat, [0.0, 600.0])[-1]) < 1e-8


def test_model_exchange_numbers_and_calls_at_the_wrong_time(model3):
    m = model3.fmu
    values = array(np.ones(14))
    assert m.getNumberOfContinuousStates() == 14
    assert m.getNumberOfEventIndicators() == 0
    model3.refused(lambda: m.getContinuousStates(pointer(values), 14), "Instantiated")
    model3.refused(lambda: m.fmi3GetNumberOfContinuousStates(m.component, None), "null pointer")
    model3.initialise()
    model3.refused(lambda: m.setContinuousStates(pointer(values), 14), "Event Mode")
    model3.refused(lambda: m.completedIntegratorStep(), "Event Mode")
    m.enterContinuousTimeMode()
    model3.refused(lambda: m.updateDiscreteStates(), "Continuous-Time Mode")
    model3.refused(lambda: m.setContinuousStates(pointer(values), 13), "found 13 values, expected 14")
    model3.refused(lambda: m.setTime(math.inf), "time is inf")
    model3.refused(lambda: m.getEventIndicators(pointer(values), 2), "found room for 2 values, expected 0")
    model3.refused(lambda: model3.set("solver.tolerance", 1e-9), "Event Mode only")
    m.getNominalsOfContinuousStates(pointer(values), 14)
    assert np.all(values > 0)
    m.enterEventMode()
    model3.set("solver.tolerance", 1e-9)
    m.terminate()
    model3.refused(lambda: m.enterEventMode(), "Terminated")


def test_a_co_simulation_state_is_no_model_exchange_state(importer3, model3):
    importer3.initialise()
    state = importer3.fmu.getFMUState()
    model3.refused(lambda: model3.fmu.setFMUState(state), "other interface")
    importer3.fmu.freeFMUState(state)
