"""The unit's outputs against closed forms and independent integrations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

import oracles
from baryscope.fmu import Session, simulate

POSITION_TOLERANCE = 1e-6  # m over one orbit
ATTITUDE_TOLERANCE = 1e-8  # rad over one orbit
CONSERVATION_TOLERANCE = 1e-10  # relative


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.05, 0.1, 0.2])
@pytest.mark.parametrize(
    "position, velocity",
    [
        pytest.param([0.0, -20.0, 0.0], [0.0, 0.0, 0.0], id="v-bar"),
        pytest.param([15.0, 30.0, -8.0], [0.004, -0.03, 0.01], id="ellipse"),
        pytest.param([300.0, -2000.0, 500.0], [0.5, -0.6, 0.3], id="far"),
    ],
)
def test_path_of_the_com_is_the_difference_of_two_kepler_orbits(envisat, envisat_fmu, eccentricity, position, velocity):
    orbit = replace(envisat.orbit, semi_major_axis=9.0e6, eccentricity=eccentricity, true_anomaly=0.7, raan=0.5)
    chaser = envisat.chaser.model_copy(update={"position": tuple(position), "velocity": tuple(velocity)})
    scenario = envisat.model_copy(update={"orbit": orbit, "chaser": chaser})

    time = np.linspace(0, orbit.period, 41)
    recording = simulate(envisat_fmu, time, scenario.parameters())

    error = np.linalg.norm(recording["target.position"] - oracles.com_in_chaser_frame(scenario, time), axis=1)
    assert error.max() < POSITION_TOLERANCE


def test_velocity_of_the_com_is_the_derivative_of_its_position(envisat, envisat_fmu):
    """Central differences over 1 s err by h²/6 of the third derivative, n³ · 20 m / 6 ≈ 4e-9 m/s here."""
    recording = simulate(envisat_fmu, np.arange(0, 600.0, 1.0))
    position, velocity = recording["target.position"], recording["target.velocity"]
    np.testing.assert_allclose((position[2:] - position[:-2]) / 2, velocity[1:-1], atol=1e-8)


def test_attitude_over_one_orbit(envisat, envisat_fmu):
    time = np.linspace(0, envisat.orbit.period, 61)
    recording = simulate(envisat_fmu, time)
    error = oracles.angle_between(recording["target.attitude"], oracles.torque_free_attitude(envisat, time))
    assert error.max() < ATTITUDE_TOLERANCE


def test_energy_and_angular_momentum_are_constant_over_one_orbit(envisat, envisat_fmu):
    recording = simulate(envisat_fmu, np.linspace(0, envisat.orbit.period, 601))
    energy, momentum = recording["target.rotationalEnergy"], recording["target.angularMomentum"]
    assert np.abs(energy / energy[0] - 1).max() < CONSERVATION_TOLERANCE
    drift = np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0])
    assert drift.max() < CONSERVATION_TOLERANCE


def test_features_are_a_rigid_body_about_the_com(envisat, envisat_fmu):
    """(7), evaluated by scipy's rotations."""
    recording = simulate(envisat_fmu, [0.0, 100.0, 1000.0])
    parameters = envisat.parameters()
    for k in range(3):
        R_I_B = Rotation.from_quat(recording["target.attitude"][k], scalar_first=True)
        expected = recording["target.position"][k] + R_I_B.apply(parameters["target.features"])
        np.testing.assert_allclose(recording["features"][k], expected, atol=1e-12)
        np.testing.assert_allclose(recording["normals"][k], R_I_B.apply(parameters["target.normals"]), atol=1e-12)


def test_gravity_gradient_turns_the_target(envisat, envisat_fmu):
    """Momentum changes by the time integral of 3μ/r³ û × Jû, taken here by Simpson's rule along the recorded motion."""
    time = np.linspace(0, 300.0, 1201)
    recording = simulate(envisat_fmu, time, {"gravityGradient": True})
    J = np.array(envisat.target.inertia)
    R_I_B = Rotation.from_quat(recording["target.attitude"], scalar_first=True)
    (target, _), mu = (
        oracles.inertial_states(envisat.orbit, [1, 0, 0], [0, 0, 0]),
        envisat.orbit.gravitational_parameter,
    )
    r = np.array([oracles.propagate_kepler(*target, mu, t)[0] for t in time], dtype=float)
    distance = np.linalg.norm(r, axis=1, keepdims=True)
    up_B = R_I_B.inv().apply(r / distance)
    torque_I = R_I_B.apply(3 * mu / distance**3 * np.cross(up_B, up_B @ J))

    momentum = recording["target.angularMomentum"]
    change = simpson(torque_I, x=time, axis=0)
    assert np.linalg.norm(change) > 1  # N m s
    np.testing.assert_allclose(momentum[-1] - momentum[0], change, atol=1e-6 * np.linalg.norm(change))


def test_torque_about_a_principal_axis_spins_the_target_up(envisat, envisat_fmu):
    """A diagonal inertia at rest under a constant torque: ω = τ t / J."""
    parameters = {
        "target.inertia.xy": 0.0, "target.inertia.xz": 0.0, "target.inertia.yz": 0.0, "target.angularRate0": [0.0] * 3,
    }  # fmt: skip
    with Session(envisat_fmu, parameters) as session:
        for _ in range(100):
            session.step(1.0, torque=[0.0, 0.0, 5.0])
        assert session["target.angularRate"] == pytest.approx([0, 0, 5.0 * 100 / 129112.2], abs=1e-15)


def test_acceleration_far_from_the_planet_is_as_commanded(envisat, envisat_fmu):
    """With almost no gravity the chaser moves by ½ a t² in LVLH axes."""
    parameters = {"orbit.gravitationalParameter": 1e-3, "chaser.velocity0": [0.0] * 3}
    start = np.array(envisat.chaser.position)
    with Session(envisat_fmu, parameters) as session:
        session.set_inputs(acceleration=[1e-3, -2e-3, 3e-3])
        session.step(50.0)
        assert session.chaser_position == pytest.approx(start + 1250 * np.array([1e-3, -2e-3, 3e-3]), abs=1e-9)


@pytest.mark.parametrize("step", [0.01, 0.1, 1.0, 7.3])
def test_the_length_of_the_steps_does_not_matter(envisat_fmu, step):
    """States at common times agree to 1e-9 over an orbit: 73 s is a multiple of all four steps."""
    names = ["target.attitude", "target.angularRate", "chaser.position", "chaser.velocity", "orbit.trueAnomaly"]
    with Session(envisat_fmu) as reference, Session(envisat_fmu) as session:
        for _ in range(82):
            reference.step(73.0)
            for _ in range(round(73.0 / step)):
                session.step(step)
            assert session.time == pytest.approx(reference.time, abs=1e-9)
            for name in names:
                np.testing.assert_allclose(session[name], reference[name], rtol=0, atol=1e-9)


def test_every_preset_simulates(preset, preset_fmu):
    recording = simulate(preset_fmu, np.linspace(0, 100, 11))
    error = np.linalg.norm(recording["target.position"] - oracles.com_in_chaser_frame(preset, recording.time), axis=1)
    assert error.max() < POSITION_TOLERANCE
