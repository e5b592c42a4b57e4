"""The flat functions of the target: order of states and outputs, and what they hold, against numpy and scipy."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import forces
from baryscope.models.scenario import load_scenario, preset_names
from baryscope.models.target import PLACE_START, tumbling_target
from baryscope.models.variables import Force, Kind


def evaluated(scenario, state=None):
    """Initial state and outputs by name, in the shapes of the table."""
    system, p = tumbling_target(len(scenario.features.points)), scenario.flat_parameters()
    x = np.array(system.initial(p)).ravel() if state is None else state
    flat = np.array(system.outputs(x, p)).ravel()
    outputs, start = {}, 0
    for variable in system.of_kind(Kind.OUTPUT):
        outputs[variable.name] = flat[start : start + variable.size].reshape(variable.shape)
        start += variable.size
    assert start == flat.size
    return x, outputs


@pytest.mark.parametrize("name", preset_names())
def test_outputs_at_the_start(name):
    scenario = load_scenario(name)
    x, outputs = evaluated(scenario)
    orbit, J = scenario.orbit, np.array(scenario.target.inertia)
    omega = np.deg2rad(scenario.target.angular_rate_deg)
    R_I_B = Rotation.from_quat(scenario.target.attitude, scalar_first=True)
    angles = [orbit.raan, orbit.inclination, orbit.argument_of_periapsis + orbit.true_anomaly]
    R_I_L = Rotation.from_euler("ZXZ", angles)
    com = -R_I_L.apply(scenario.chaser.position)

    points = np.array([point.position for point in scenario.features.points])
    normals = np.array([point.normal for point in scenario.features.points])
    np.testing.assert_allclose(outputs["target.position"], com, atol=1e-12)
    np.testing.assert_allclose(outputs["features"], com + R_I_B.apply(points), atol=1e-12)
    np.testing.assert_allclose(outputs["normals"], R_I_B.apply(normals), atol=1e-14)
    np.testing.assert_allclose(outputs["target.attitude"], R_I_B.as_quat(scalar_first=True), atol=1e-14)
    np.testing.assert_array_equal(outputs["target.angularRate"], omega)
    np.testing.assert_array_equal(outputs["chaser.position"], scenario.chaser.position)
    np.testing.assert_array_equal(outputs["chaser.velocity"], scenario.chaser.velocity)
    assert outputs["orbit.trueAnomaly"] == orbit.true_anomaly
    assert outputs["target.rotationalEnergy"] == pytest.approx(omega @ J @ omega / 2, rel=1e-14)
    np.testing.assert_allclose(outputs["target.angularMomentum"], R_I_B.apply(J @ omega), rtol=1e-12)
    assert x.size == 14


def test_outputs_don_t_depend_on_the_length_of_the_quaternion():
    """An integrator lets |q| drift: positions must not stretch with it."""
    scenario = load_scenario("envisat")
    x, outputs = evaluated(scenario)
    x[:4] *= 1.001
    np.testing.assert_allclose(evaluated(scenario, x)[1]["features"], outputs["features"], atol=1e-12)


def test_nominals_are_the_sizes_of_the_states():
    scenario = load_scenario("envisat")
    scales = np.array(tumbling_target(12).nominals(scenario.flat_parameters())).ravel()
    n = 2 * np.pi / scenario.orbit.period
    rate = np.deg2rad(np.linalg.norm(scenario.target.angular_rate_deg))
    np.testing.assert_allclose(scales, [1] * 4 + [rate] * 3 + [1] + [20] * 3 + [20 * n] * 3, rtol=1e-12)


def test_one_system_per_number_of_features():
    assert tumbling_target(5) is tumbling_target(5)
    assert tumbling_target(5).outputs.size1_out(0) == 6 * 5 + 24


@pytest.mark.parametrize("preset", ["envisat", "upper-stage"])
@pytest.mark.parametrize("with_forces", [False, True])
def test_the_rates_of_the_series_are_those_of_the_attitude_in_other_axes(preset, with_forces):
    """They are held against the printed equations; J must be diagonal in the axes."""
    scenario = load_scenario(preset)
    target = scenario.target.model_copy(update={"gravity_gradient": True})
    scenario = scenario.model_copy(update={"target": target} | ({"eddy_currents": forces.EDDY} if with_forces else {}))
    system, p, rng = scenario.system, scenario.flat_parameters(), np.random.default_rng(3)
    x, c, s = (np.array(f(p)).ravel() for f in (system.initial, system.constants, system.series_constants))
    x, u = x[: PLACE_START + system.place_size], rng.normal(size=6)
    x[:7] = np.concatenate([Rotation.random(rng=rng).as_quat(scalar_first=True), rng.normal(scale=0.05, size=3)])
    found, torque = (np.array(value).ravel() for value in system.to_series(x[:7], u, s))
    np.testing.assert_allclose(np.array(system.from_series(found, s)).ravel(), x[:7], atol=1e-14)

    moments, R_B_D = s[:3], s[-9:].reshape(3, 3).T
    J = R_B_D @ np.diag(moments) @ R_B_D.T
    np.testing.assert_allclose(J, scenario.target.inertia, atol=1e-14 * moments.max())
    R_P_D = Rotation.from_quat(x[:4], scalar_first=True) * Rotation.from_matrix(R_B_D)
    if not with_forces:
        orbit = scenario.orbit
        R_P_D = Rotation.from_euler("ZXZ", [orbit.raan, orbit.inclination, orbit.argument_of_periapsis]).inv() * R_P_D
    R = Rotation.from_quat(found[:4], scalar_first=True).as_matrix()
    np.testing.assert_allclose(R, R_P_D.as_matrix(), atol=1e-14)

    expected = np.array(system.attitude_rates(x, u, c)).ravel()
    rates = np.array(system.series_rates(np.concatenate([found, x[7:]]), torque, s, 1.0)).ravel()
    np.testing.assert_allclose(np.array(system.from_series(rates[:7], s)).ravel(), expected[:7], rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(rates[7:], expected[7:], rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("forces", [frozenset(), frozenset(Force)], ids=["none", "all"])
def test_no_constant_depends_on_a_tunable_real(forces):
    """Derivatives in a run hold the constants, and are those by tunable Reals only for this reason."""
    system = tumbling_target(3, forces)
    scalars = [v for v in system.of_kind(Kind.PARAMETER) for _ in range(v.size)]
    depends = np.array(ca.DM(system.constants.jac_sparsity(0, 0), 1)).any(axis=0)
    assert not [v.name for v, found in zip(scalars, depends, strict=True) if found and v.tunable and not v.boolean]
    assert depends.any()
