"""The target's states against an integration by scipy, and gravity's gradient and difference against each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from baryscope.models.ephemeris.trajectory import (
    gravity_difference,
    gravity_gradient,
    kepler_states,
    lvlh_axes,
    target_states,
)
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import EARTH_J2, EARTH_MU, EARTH_RADIUS, Orbit
from oracles import inertial_states, oblate_gravity, propagate_kepler

KEPLER = Orbit(9.1e6, 0.2, 1.2, 0.3, 0.7, 0.4)
OBLATE = replace(KEPLER, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS)


def test_states_on_the_ellipse_are_those_of_lagrange():
    time = np.linspace(-3.0, 2.0, 11) * KEPLER.period
    start, _ = inertial_states(KEPLER, np.zeros(3), np.zeros(3))
    expected = np.array([np.concatenate(propagate_kepler(*start, EARTH_MU, t)) for t in time], dtype=float)
    np.testing.assert_allclose(target_states(KEPLER, time)[:, :3], expected[:, :3], atol=1e-6)
    np.testing.assert_allclose(target_states(KEPLER, time)[:, 3:], expected[:, 3:], atol=1e-9)


@pytest.mark.parametrize("eccentricity", [0.0, 0.2, 0.6])
def test_states_under_j2(eccentricity):
    """A millimetre over a turn either way, where J2 moves the target by kilometres."""
    orbit = replace(OBLATE, eccentricity=eccentricity, semi_major_axis=7.2e6 / (1 - eccentricity))
    start = kepler_states(orbit, np.zeros(1))[0]
    for end in (-orbit.period, 1.3 * orbit.period):
        time = np.linspace(0, end, 57)
        solution = solve_ivp(
            lambda _, s: np.concatenate([s[3:], oblate_gravity(s[:3])]), (0, end), start, "DOP853", time,
            rtol=1e-13, atol=1e-6,
        )  # fmt: skip
        found = target_states(orbit, time)
        np.testing.assert_allclose(found[:, :3], solution.y[:3].T, atol=2e-3)
        np.testing.assert_allclose(found[:, 3:], solution.y[3:].T, atol=1e-4)
        assert np.abs(found[-1] - kepler_states(orbit, time)[-1])[:3].max() > 1e3


def test_the_gradient_is_that_of_the_difference():
    states = target_states(OBLATE, np.linspace(0, OBLATE.period, 7))
    step = 10.0
    for orbit in (KEPLER, OBLATE):
        ends = [[gravity_difference(orbit, states, np.tile(h, (7, 1))) for h in s * np.eye(3)] for s in (step, -step)]
        found = gravity_gradient(orbit, states)
        np.testing.assert_allclose(
            np.stack(np.subtract(*ends), axis=2) / (2 * step), found, atol=1e-9 * np.abs(found).max()
        )
    expected = np.array([oblate_gravity(r + 1e5) - oblate_gravity(r) for r in states[:, :3]])
    np.testing.assert_allclose(gravity_difference(OBLATE, states, np.full((7, 3), 1e5)), expected, rtol=1e-10)


def test_axes_along_the_path():
    states = target_states(KEPLER, np.linspace(0, KEPLER.period, 9))
    R = lvlh_axes(states)
    np.testing.assert_allclose(R @ np.swapaxes(R, 1, 2), np.tile(np.eye(3), (9, 1, 1)), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(R), 1)
    local = np.einsum("nji,nj->ni", R, states[:, :3])
    np.testing.assert_allclose(local[:, 1:], 0, atol=1e-8)
    assert (local[:, 0] > 0).all()
    assert (np.einsum("nji,nj->ni", R, states[:, 3:])[:, 1] > 0).all()


def test_too_far_from_time_0():
    with pytest.raises(ComputationError, match="turns away from time 0 of the orbit, too many"):
        target_states(OBLATE, np.array([1e10]))
