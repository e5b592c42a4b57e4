"""Against conservation laws and the closed forms of simple motions."""

import numpy as np
import pytest

from baryscope.study.population.third.dice import matrices, rotation
from baryscope.study.population.third.forces import MU
from baryscope.study.population.third.tumble import SHAPES, Torques, drawn, tumbled

INERTIA = np.array([[0.45, 0.02, -0.01], [0.02, 0.33, 0.015], [-0.01, 0.015, 0.22]])
RATE = np.array([0.03, -0.05, 0.08])
TIME = np.linspace(0, 300, 151)
FIXED = np.array([7e6, 0.0, 0.0])  # m, where a target stays


def tumble(inertia=INERTIA, rate=RATE, time=TIME, R=None, **torques):
    R = rotation(np.random.default_rng(4)) if R is None else R
    return tumbled((R, np.asarray(rate, float)), inertia, time, Torques(**torques), lambda t: FIXED)


def test_a_free_tumble_keeps_momentum_and_energy():
    found = tumble()
    momentum = np.einsum("nij,jk,nk->ni", found.attitude, INERTIA, found.rate)
    energy = np.einsum("ni,ij,nj->n", found.rate, INERTIA, found.rate)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-11)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_a_symmetric_body_nutates_as_in_the_closed_form():
    across, along = 0.4, 0.2
    found = tumble(np.diag([across, across, along]), [0.05, 0.0, 0.1])
    turned = (along - across) / across * 0.1 * TIME
    expected = np.stack([0.05 * np.cos(turned), 0.05 * np.sin(turned), np.full(len(TIME), 0.1)], axis=1)
    np.testing.assert_allclose(found.rate, expected, atol=1e-10)


def test_the_attitude_turns_at_the_rate():
    time = np.linspace(0, 1e-2, 3)
    found = tumble(time=time)
    change = found.attitude[1].T @ (found.attitude[2] - found.attitude[0]) / 1e-2
    np.testing.assert_allclose([change[2, 1], change[0, 2], change[1, 0]], found.rate[1], atol=1e-8)


@pytest.mark.parametrize("unknown", range(8))
def test_turn_is_how_attitudes_depend_on_rate_and_inertia(unknown):
    step = 1e-5
    ends = []
    for sign in (1, -1):
        rate, inertia = RATE.copy(), INERTIA.copy()
        if unknown < 3:
            rate[unknown] += sign * step
        else:
            inertia = inertia + sign * step * SHAPES[unknown - 3]
        ends.append(tumble(inertia, rate).attitude)
    plain = tumble()
    change = np.einsum("nji,njk->nik", plain.attitude, ends[0] - ends[1]) / (2 * step)
    vectors = np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=1)
    found = plain.turn[:, :, unknown]
    np.testing.assert_allclose(found, vectors, atol=1e-4 * np.abs(vectors).max())  # (step · 300 s)² / 6 of it at most


def test_the_shapes_keep_the_trace_and_are_independent():
    assert not np.trace(SHAPES, axis1=1, axis2=2).any()
    assert np.linalg.matrix_rank(SHAPES.reshape(5, 9)) == 5


def test_eddy_currents_damp_a_rate_across_the_field_exponentially():
    found = tumble(np.eye(3) / 3, [0.1, 0, 0], R=np.eye(3), eddy=1e-3)  # the field at the equator is along z
    np.testing.assert_allclose(found.rate[:, 0], 0.1 * np.exp(-3e-3 * TIME), rtol=1e-9)


def test_gravity_lets_a_long_body_swing_about_the_vertical():
    A, B, C = 0.1, 0.45, 0.45
    angle, time = 1e-3, np.linspace(0, 3000, 50)
    R = matrices(np.array([[np.cos(angle / 2), 0, 0, np.sin(angle / 2)]]))[0]
    found = tumble(np.diag([A, B, C]), np.zeros(3), time, R, gradient=True)
    swing = np.sqrt(3 * MU / 7e6**3 * (B - A) / C)
    np.testing.assert_allclose(found.attitude[:, 1, 0], angle * np.cos(swing * time), atol=1e-8)  # angle³


def test_weight_off_the_bearing_lets_a_body_swing():
    angle, time = 1e-3, np.linspace(0, 60, 50)
    R = matrices(np.array([[np.cos(angle / 2), np.sin(angle / 2), 0, 0]]))[0]
    found = tumble(np.diag([0.4, 0.35, 0.25]), np.zeros(3), time, R, unbalance=(0.0, 0.0, -0.02))
    np.testing.assert_allclose(found.attitude[:, 2, 1], angle * np.cos(np.sqrt(0.02 / 0.4) * time), atol=1e-8)


def test_a_steady_torque_speeds_a_body_up_evenly():
    found = tumble(np.diag([0.4, 0.35, 0.25]), np.zeros(3), steady=(0.0, 0.0, 1e-5))
    np.testing.assert_allclose(found.rate[:, 2], 1e-5 / 0.25 * TIME, atol=1e-12)


def test_a_growing_inertia_slows_the_spin_down():
    time = TIME + 1000.0  # it grows from the first time on
    found = tumble(np.diag([0.4, 0.35, 0.25]), [0, 0, 0.1], time, growth=(0.0, 0.0, 1e-4))
    np.testing.assert_allclose(found.rate[:, 2], 0.1 * 0.25 / (0.25 + 1e-4 * TIME), rtol=1e-9)


def test_a_slug_of_fuel_takes_energy_and_no_momentum():
    mass, damping = 0.02, 1.0
    time = np.linspace(0, 2000, 200)
    found = tumble(rate=[0.1, 0.02, 0.01], time=time, slug=(mass, damping))
    whole = INERTIA + mass * np.eye(3)
    momentum = np.einsum("nij,jk,nk->ni", found.attitude, whole, found.rate)
    energy = np.einsum("ni,ij,nj->n", found.rate, whole, found.rate)
    # The slug lags by ω̇ / damping, 1e-3 rad/s, which counts with its mass.
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-3 * mass)
    assert energy[-1] < energy[0] * (1 - 1e-3)


def test_only_torques_that_are_named_are_drawn():
    assert drawn(np.random.default_rng(1), ("burns",), 0.1, 100.0) == Torques()
