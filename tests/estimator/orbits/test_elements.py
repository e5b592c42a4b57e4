"""Elements at a moment, and the places on an orbit that a relative motion tells, against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from baryscope.estimator.orbits.elements import LocalElements, places_on_orbit
from baryscope.models.ephemeris.trajectory import target_states
from baryscope.models.errors import InputError
from baryscope.models.orbit import Orbit
from synthetic import MU
from synthetic import Orbit as Written

ELLIPSE = Written(semi_major_axis=26.6e6, eccentricity=0.6).model()
UNITS = st.floats(-1.0, 1.0)


def state_of(orbit: Orbit, time: float) -> np.ndarray:
    return target_states(orbit, np.array([time]))[0]


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.floats(7e6, 5e7), arrays(float, 3, elements=UNITS), arrays(float, 3, elements=st.floats(1.0, 40.0)))
def test_a_place_follows_from_position_and_acceleration(distance, turn, position):
    """For any u, r and p, with p̈ = μ (3 (u·p) u − p)/r³ written down."""
    u = Rotation.from_rotvec(3 * turn).apply([1.0, 0.0, 0.0])
    acceleration = MU / distance**3 * (3 * (u @ position) * u - position)
    found = places_on_orbit(position[None], acceleration[None], MU)[0]
    # Where u is across p its angle is told by a small difference.
    across = abs(u @ position) / np.linalg.norm(position)
    assert np.linalg.norm(found) == pytest.approx(distance, rel=1e-9)
    assert abs(found @ u) == pytest.approx(distance, rel=1e-9) or across < 1e-4


def test_places_are_one_beside_the_other():
    time = np.linspace(0.0, 5000.0, 21)
    up = target_states(ELLIPSE, time)[:, :3]
    size = np.linalg.norm(up, axis=1, keepdims=True)
    position = np.column_stack([20 + 1e-3 * time, 1e-3 * time - 8, np.full(21, 5.0)])
    acceleration = MU / size**3 * (3 * np.sum(up * position, axis=1, keepdims=True) / size * up / size - position)
    found = places_on_orbit(position, acceleration, MU)
    np.testing.assert_allclose(found * np.sign(found[0] @ up[0]), up, rtol=1e-9, atol=1e-2)
    assert places_on_orbit(position, np.zeros((21, 3)), MU) is None


@pytest.mark.parametrize("time", [0.0, 3000.0, -40_000.0])
def test_elements_lead_back_to_the_orbit(time):
    state = state_of(ELLIPSE, time)
    found = LocalElements.through(state[:3], state[3:], MU).orbit(time, MU)
    np.testing.assert_allclose(state_of(found, 1000.0), state_of(ELLIPSE, 1000.0), rtol=1e-9)


def test_period_and_eccentricity_are_those_of_the_orbit():
    state = state_of(ELLIPSE, 3000.0)
    found = LocalElements.through(state[:3], state[3:], MU)
    assert found.period == pytest.approx(ELLIPSE.period, rel=1e-12)
    assert found.eccentricity == pytest.approx(0.6, rel=1e-12)


def test_to_turn_an_orbit_leaves_its_shape():
    """R exp(φ) turns the state by R exp(φ) Rᵀ, scipy's rotation."""
    state, turn = state_of(ELLIPSE, 3000.0), np.array([0.4, -0.8, 1.1])
    elements = LocalElements.through(state[:3], state[3:], MU)
    turned = elements.moved(np.concatenate([turn, np.zeros(3)])).orbit(3000.0, MU)
    R = elements.axes @ Rotation.from_rotvec(turn).as_matrix() @ elements.axes.T
    np.testing.assert_allclose(state_of(turned, 3000.0), [*R @ state[:3], *R @ state[3:]], rtol=1e-9)
    assert turned.period == pytest.approx(ELLIPSE.period, rel=1e-12)


def test_a_circle_passes_the_same_place_in_the_same_plane():
    state = state_of(ELLIPSE, 3000.0)
    circle = LocalElements.of_circle(state[:3], state[3:], MU)
    found = state_of(circle.orbit(3000.0, MU), 3000.0)
    np.testing.assert_allclose(found[:3], state[:3], rtol=1e-9)
    assert found[3:] @ np.cross(state[:3], state[3:]) == pytest.approx(0.0, abs=1.0)
    assert circle.eccentricity == 0.0


def test_an_open_orbit_is_none():
    state = state_of(ELLIPSE, 3000.0)
    with pytest.raises(InputError):
        LocalElements.through(state[:3], 3 * state[3:], MU).orbit(0.0, MU)
