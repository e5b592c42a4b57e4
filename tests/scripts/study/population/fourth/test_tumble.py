"""Against conservation laws, a closed form and tumbles that start a little elsewhere."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.study.population.fourth.bodies import drawn_mass
from baryscope.study.population.fourth.tumble import SHAPES, Tumble, drawn

INERTIA = np.array([[0.45, 0.02, -0.01], [0.02, 0.33, 0.015], [-0.01, 0.015, 0.22]])
RATE = np.array([0.03, -0.05, 0.08])  # rad/s
TIME = 50 + np.linspace(0, 300, 151)
QUATERNION = np.array([0.5, 0.1, -0.7, 0.5])  # (w, x, y, z)


def tumble(inertia=INERTIA, rate=RATE):
    return Tumble(inertia, np.asarray(rate, float), QUATERNION / np.linalg.norm(QUATERNION), 50.0)


def test_a_free_tumble_keeps_momentum_and_energy():
    attitude, rate = tumble().at(TIME)
    momentum = np.einsum("nij,jk,nk->ni", attitude, INERTIA, rate)
    energy = np.einsum("ni,ij,nj->n", rate, INERTIA, rate)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-11)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_a_symmetric_body_nutates_as_in_the_closed_form():
    across, along = 0.4, 0.2
    _, rate = tumble(np.diag([across, across, along]), [0.05, 0.0, 0.1]).at(TIME)
    turned = (along - across) / across * 0.1 * (TIME - 50)
    expected = np.stack([0.05 * np.cos(turned), 0.05 * np.sin(turned), np.full(len(TIME), 0.1)], axis=1)
    np.testing.assert_allclose(rate, expected, atol=1e-10)


def test_the_attitude_begins_with_the_quaternion_and_turns_at_the_rate():
    attitude, rate = tumble().at(50 + np.array([0, 5e-3, 1e-2]))
    np.testing.assert_allclose(attitude[0], Rotation.from_quat(np.roll(QUATERNION, -1)).as_matrix(), atol=1e-12)
    change = attitude[1].T @ (attitude[2] - attitude[0]) / 1e-2
    np.testing.assert_allclose([change[2, 1], change[0, 2], change[1, 0]], rate[1], atol=1e-8)


@pytest.mark.parametrize("unknown", range(8))
def test_turn_is_how_attitudes_depend_on_rate_and_inertia(unknown):
    step, plain = 1e-5, tumble()
    rate, inertia = RATE.copy(), INERTIA.copy()
    if unknown < 3:
        rate[unknown] += step
    else:
        inertia = inertia + step * np.trace(INERTIA) * SHAPES[unknown - 3]
    change = np.swapaxes(plain.at(TIME)[0], 1, 2) @ tumble(inertia, rate).at(TIME)[0]
    vectors = Rotation.from_matrix(change).as_rotvec() / step
    found = plain.turn(TIME)[:, :, unknown]
    np.testing.assert_allclose(found, vectors, atol=0.01 * np.abs(vectors).max())  # step · 300 s, of second order


def test_the_shapes_keep_the_trace_and_are_independent():
    assert not np.trace(SHAPES, axis1=1, axis2=2).any()
    assert np.linalg.matrix_rank(SHAPES.reshape(5, 9)) == 5


def test_spins_are_about_a_principal_axis():
    for seed in range(200):
        rng = np.random.default_rng(seed)
        mass = drawn_mass(rng)
        found, name = drawn(rng, mass, 0.1, 0.0)
        assert np.linalg.norm(found.rate) == pytest.approx(0.1)
        off = np.degrees(np.arccos(min(1.0, np.abs(mass.axes.T @ found.rate).max() / 0.1)))
        assert off < {"tumble": 90, "near spin": 6.1, "pure spin": 1e-5}[name]
