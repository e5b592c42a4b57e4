"""The forces of the worlds, against the potential, energy, and each other."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.models.orbit import EARTH_J2, EARTH_MU, EARTH_RADIUS
from baryscope.study.population.motion import orbit_state, relative_motion
from baryscope.study.world.disturbances import MODES, disturbance_of
from baryscope.study.world.forces import burns_of, eddy_torque, force_of, j2_acceleration
from baryscope.study.world.scenes import INERTIA, RATE, scene
from baryscope.study.world.worlds import LOW, WORLDS


def test_j2_is_the_gradient_of_the_zonal_potential():
    def potential(place):
        r = np.linalg.norm(place)
        return -EARTH_MU / r * EARTH_J2 * (EARTH_RADIUS / r) ** 2 * (1.5 * (place[2] / r) ** 2 - 0.5)

    place, step = np.array([4e6, -3e6, 5e6]), 100.0
    slope = [(potential(place + step * e) - potential(place - step * e)) / (2 * step) for e in np.eye(3)]
    np.testing.assert_allclose(j2_acceleration(EARTH_MU, place[None])[0], slope, rtol=1e-7)


def test_eddy_currents_brake_the_turn_across_the_field_only():
    torque = eddy_torque(WORLDS["eddy currents"], INERTIA, lambda t: np.array([1.0, 0.0, 0.0]))
    R = Rotation.random(4, random_state=2).as_matrix()
    found = torque(0.0, R, np.tile(RATE, (4, 1)))
    assert (found @ RATE < 0).all()
    # the field stays in I; the torques are normal to it
    field = np.linalg.svd(np.einsum("kij,kj->ki", R, found))[2][2]
    np.testing.assert_allclose(np.einsum("kij,kj->ki", R, found) @ field, 0, atol=1e-12 * np.abs(found).max())


def test_the_wrong_orbit_is_off_by_a_kilometre_and_a_degree():
    made = scene(WORLDS["orbit file wrong"], 1, 0)
    true = scene(WORLDS["J2"], 1, 0)
    told, right = orbit_state(made.orbit), orbit_state(true.orbit)
    lengths, expected = ([np.linalg.norm(state[:3]), np.linalg.norm(state[3:])] for state in (told, right))
    assert 10.0 < abs(lengths[0] - expected[0]) < 1e3  # of the shift only the part upwards, in any direction
    assert np.linalg.norm(told[:3] - right[:3]) < 1e3 + np.deg2rad(1) * 7.2e6
    np.testing.assert_allclose(lengths[1], expected[1], rtol=1e-12)
    cosine = told[3:] @ right[3:] / expected[1] ** 2
    assert 0.1 < np.rad2deg(np.arccos(cosine)) < 1.0  # of the turn only the part across the velocity
    np.testing.assert_array_equal(made.path, true.path)


def test_a_column_of_white_acceleration_is_the_response_to_its_cosine():
    world, time = WORLDS["white 1e-12"], np.linspace(0, 600, 7)
    found = disturbance_of(world, LOW, time, np.zeros((7, 3)))
    order, size = 3, 1e-5

    def force(t, here, others):
        return np.array([[0, 0, 0], [0, size * np.sqrt(2 / 600) * np.cos(np.pi * order * t / 600), 0]])

    start = np.array([[0.0, -20, 0, 0, 0, 0]])
    forced, coasted = (relative_motion(LOW, start, time, f)[0][0, :, :3] for f in (force, None))
    assert found.columns.shape == (7, 3, 3 * MODES)
    np.testing.assert_allclose(found.columns[:, :, 3 * order + 1], -(forced - coasted) / size, rtol=1e-4, atol=1e-2)


def test_burns_are_felt_while_they_last():
    world, rng = WORLDS["thrust not logged"], np.random.default_rng(1)
    burns = burns_of(world, rng)
    force, breaks = force_of(world, rng, LOW, burns)
    assert set(breaks) == {edge for burn in burns for edge in (burn.begin, burn.end)}
    here, others = orbit_state(LOW), np.array([[0.0, -20, 0, 0, 0, 0]])
    first = burns[0]
    size = np.linalg.norm(force((first.begin + first.end) / 2, here, others)[1])
    assert 1e-3 <= np.linalg.norm(first.acceleration) <= 3e-3
    assert size > 0
    assert np.linalg.norm(force(max(burn.end for burn in burns) + 1, here, others)) == 0
