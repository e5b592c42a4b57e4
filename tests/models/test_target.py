"""The flat functions of the target: order of states and outputs, and what they hold, against numpy and scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import load_scenario, preset_names
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind


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
