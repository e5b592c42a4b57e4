"""The unit in other people's programs: CasADi's importer, libcosimpy (libcosim), ecospy (Ecos).

fmpy is the importer of all the other tests. What the packages cannot load on this machine is skipped with the reason.
"""

import importlib

import casadi as ca
import fmpy
import numpy as np
import pytest

from baryscope.fmu import Session, build_fmu
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind

STEP, STEPS = 0.5, 20
PARAMETERS = {"orbit.inclination": 0.5}
INPUTS = {"chaser.acceleration[1]": 1e-3, "target.torque[2]": 4.0}
OUTPUTS = ["chaser.position[1]", "chaser.velocity[3]", "features[12,3]", "normals[1,2]", "target.attitude[4]"]
# The importers add up the time in nanoseconds or by steps, which moves the unit's own steps by rounding.
AGREEMENT = 1e-11


@pytest.fixture(scope="module")
def expected(envisat_fmu):
    """The outputs at the end by our own session."""
    with Session(envisat_fmu, PARAMETERS) as session:
        session.set_inputs(acceleration=[1e-3, 0.0, 0.0], torque=[0.0, 4.0, 0.0])
        for _ in range(STEPS):
            session.step(STEP)
        outputs = {v.name: session[v.name].ravel() for v in session.variables if v.kind == "output"}
        names = {v.name: v.scalar_names for v in session.variables}
    return np.array(
        [outputs[stem][names[stem].index(name)] for name in OUTPUTS for stem in [name.split("[")[0]]], dtype=float
    )


def test_casadi_evaluates_and_differentiates_the_unit(envisat, envisat_fmu, tmp_path):
    """CasADi's importer (it sets states by fmi2SetReal) against CasADi's own functions of the same model."""
    fmpy.extract(str(envisat_fmu), str(tmp_path))
    unit = ca.DaeBuilder("unit", str(tmp_path))
    imported = unit.create("imported", ["x", "u"], ["ode", "y"])
    jacobian = imported.factory("J", ["x", "u"], ["jac:ode:x", "jac:ode:u", "jac:y:x", "jac:y:u"])

    p, system = envisat.flat_parameters(), tumbling_target(12)
    x, u = ca.SX.sym("x", 14), ca.SX.sym("u", 6)
    ode, y = system.rhs(x, u, p), system.outputs(x, p)
    blocks = [ca.jacobian(f, v) for f in (ode, y) for v in (x, u)]
    own, own_jacobian = ca.Function("f", [x, u], [ode, y]), ca.Function("J", [x, u], blocks)

    rng = np.random.default_rng(8)
    point = np.array(system.initial(p)).ravel() + 0.01 * rng.normal(size=14), rng.normal(size=6)
    for found, wanted in zip(imported(*point), own(*point), strict=True):
        np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-12, atol=1e-13)
    for found, wanted in zip(jacobian(*point), own_jacobian(*point), strict=True):
        dense = np.array(ca.densify(wanted))
        np.testing.assert_allclose(np.array(ca.densify(found)), dense, rtol=1e-12, atol=1e-12 * np.abs(dense).max())


@pytest.mark.parametrize("unit", ["envisat_fmu", "envisat_fmu3_scalar"], ids=["fmi2", "fmi3"])
def test_casadi_evaluates_the_unit_at_its_starts_with_parameters(envisat, unit, tmp_path, request):
    """CasADi sets tunable parameters in Continuous-Time Mode, to what they are, and takes states' starts."""
    fmpy.extract(str(request.getfixturevalue(unit)), str(tmp_path))
    unit = ca.DaeBuilder("unit", str(tmp_path))
    starts, tunable, u = np.array(unit.start(unit.x())), np.array(unit.start(unit.p())), np.array([0.1] * 6)
    p, system = envisat.flat_parameters(), tumbling_target(12)
    np.testing.assert_array_equal(starts, np.array(system.initial(p)).ravel())

    imported = unit.create("imported", ["x", "u", "p"], ["ode", "y"])
    for found, wanted in zip(
        imported(starts, u, tunable), (system.rhs(starts, u, p), system.outputs(starts, p)), strict=True
    ):
        np.testing.assert_allclose(np.array(found), np.array(wanted), rtol=1e-12, atol=1e-13)

    symbols = ca.SX.sym("p", len(p))
    places = [index for v, index in _parameter_places(system) if v.tunable and not v.boolean]
    own = ca.Function("J", [symbols], [ca.jacobian(system.outputs(starts, symbols), symbols)[:, places]])(p)
    found = imported.factory("J", ["x", "u", "p"], ["jac:y:p"])(starts, u, tunable)
    np.testing.assert_allclose(np.array(ca.densify(found)), np.array(ca.densify(own)), rtol=1e-12, atol=1e-13)


def _parameter_places(system):
    """Every scalar of the parameters: its variable and its place."""
    scalars = [v for v in system.of_kind(Kind.PARAMETER) for _ in range(v.size)]
    return [(variable, index) for index, variable in enumerate(scalars)]


@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_integrates_the_unit_under_a_changing_input(envisat, envisat_fmu, envisat_fmu3_scalar, fmi):
    """By Model Exchange at the default experiment's tolerance, against Co-Simulation.

    fmpy's solver is not restarted where an input changes: it goes ahead with the former one for some steps.
    """
    unit, output = (envisat_fmu if fmi == 2 else envisat_fmu3_scalar), "target.angularRate[1]"
    time = np.linspace(0.0, 20.0, 201)
    torque = 10.0 * np.sin(time)
    signal = np.array(list(zip(time, torque, strict=True)), dtype=[("time", float), ("target.torque[1]", float)])
    found = fmpy.simulate_fmu(
        str(unit), fmi_type="ModelExchange", stop_time=20.0, output_interval=0.1, input=signal, output=[output]
    )[output]
    wanted = [found[0]]
    with Session(envisat_fmu) as session:
        for value in torque[:-1]:
            session.step(0.1, torque=[value, 0.0, 0.0])
            wanted.append(session["target.angularRate"][0])
    assert len(found) == len(wanted)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=0.2 * np.ptp(wanted))


def test_the_tolerance_of_an_importer_does_not_loosen_that_of_the_unit(any_fmu):
    """fmpy hands the default experiment's to the unit; the unit keeps its own."""
    name = "target.attitude" if any_fmu.stem == "envisat3" else "target.attitude[4]"
    found = fmpy.simulate_fmu(str(any_fmu), stop_time=100.0, output_interval=100.0, output=[name])
    with Session(any_fmu) as session:
        session.step(100.0)
        assert np.ravel(found[name][-1])[-1] == session.attitude[3]


@pytest.mark.filterwarnings("ignore:'ctypes.POINTER with string':DeprecationWarning")  # its, on 3.14
def test_libcosim_steps_the_unit(envisat_fmu, expected):
    package = "libcosimpy"
    pytest.importorskip(package, reason=f"{package} has wheels for Linux and Windows on x86-64")
    part = {name: importlib.import_module(f"{package}.Cosim{name}") for name in _PARTS}
    part["Logging"].log_output_level(part["Logging"].CosimLogLevel.ERROR)
    references = {v.name: v.valueReference for v in fmpy.read_model_description(str(envisat_fmu)).modelVariables}
    execution = part["Execution"].CosimExecution.from_step_size(int(STEP * 1e9))
    slave = execution.add_local_slave(part["Slave"].CosimLocalSlave(str(envisat_fmu), "unit"))
    for name, value in (PARAMETERS | INPUTS).items():
        assert execution.real_initial_value(slave, references[name], value)
    observer = part["Observer"].CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    assert execution.step(STEPS)
    found = observer.last_real_values(slave, [references[name] for name in OUTPUTS])
    np.testing.assert_allclose(found, expected, rtol=AGREEMENT, atol=AGREEMENT)


_PARTS = ("Execution", "Logging", "Observer", "Slave")


@pytest.mark.parametrize("fmi", [2, 3])
def test_ecos_steps_the_unit(envisat, tmp_path, expected, fmi):
    """In FMI 3 with scalars, since Ecos does not support arrays."""
    ecospy = _ecospy()
    unit = build_fmu(envisat, tmp_path / "unit.fmu", fmi=fmi, scalar=True)
    with ecospy.EcosSimulationStructure() as structure:
        structure.add_model("unit", str(unit))
        structure.add_parameter_set("start", {f"unit::{name}": value for name, value in (PARAMETERS | INPUTS).items()})
        with ecospy.EcosSimulation(structure=structure, step_size=STEP) as simulation:
            simulation.init(parameter_set="start")
            simulation.step(STEPS)
            found = [simulation.get_real(f"unit::{name}") for name in OUTPUTS]
    np.testing.assert_allclose(found, expected, rtol=AGREEMENT, atol=AGREEMENT)


def _ecospy():
    try:
        return importlib.import_module("ecospy")
    except ImportError as problem:
        pytest.skip(f"ecospy has libraries for Linux and Windows on x86-64 only ({problem})")
    except OSError as problem:
        pytest.skip(f"ecospy needs the system's libtbb.so.12, in Debian's package libtbb12 ({problem})")
