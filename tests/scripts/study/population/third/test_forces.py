"""Accelerations against closed forms, and what is drawn against its limits."""

import numpy as np
import pytest

from baryscope.study.population.third import forces
from baryscope.study.population.third.forces import EARTH_RADIUS, MU, Drag, Forces, Light, drawn, natural


def potential(r):
    """Of J2 alone (Vallado, Fundamentals of Astrodynamics, 8.6)."""
    distance = np.linalg.norm(r)
    sine = r[2] / distance
    return -MU / distance * forces.J2 * (EARTH_RADIUS / distance) ** 2 * (3 * sine**2 - 1) / 2


def test_j2_is_the_gradient_of_its_potential():
    r = np.array([4.1e6, -3.3e6, 4.4e6])
    steps = 100.0 * np.eye(3)
    gradient = [(potential(r + step) - potential(r - step)) / 200.0 for step in steps]
    np.testing.assert_allclose(natural(Forces(j2=True), r, np.zeros(3), 0), gradient, rtol=1e-6)


def test_drag_of_a_circular_equatorial_orbit_is_against_the_wind():
    r = np.array([EARTH_RADIUS + 4.5e5 + 6.5e4, 0, 0])  # a scale height above the reference
    v = np.array([0, 7600.0, 0])
    drag = Drag(1e-12, 0.5, (1.0, 0.0, 0.0), (0.01, 0.02))
    wind = 7600.0 - 7.2921159e-5 * r[0]
    expected = -0.5 * 1e-12 / np.e * 1.5 * 0.02 * wind**2
    np.testing.assert_allclose(natural(Forces(drag=drag), r, v, 1), [0, expected, 0], rtol=1e-12)


def test_light_presses_away_from_the_sun_and_not_behind_the_earth():
    light = Forces(light=Light((1.0, 0.0, 0.0), (0.02, 0.05)))
    day, night, edge = (np.array(r) for r in ([4.2e7, 0, 0], [-4.2e7, 1e6, 0], [-4.2e7, EARTH_RADIUS, 0]))
    full = np.array([-4.56e-6 * 0.05, 0, 0])
    np.testing.assert_allclose(natural(light, day, day, 1), full)
    np.testing.assert_allclose(natural(light, night, day, 1), 0, atol=1e-30)
    np.testing.assert_allclose(natural(light, edge, day, 1), full / 2)


@pytest.mark.parametrize("seed", range(20))
def test_burns_are_within_the_span_and_move_the_chaser_by_less_than_the_range(seed):
    found = drawn(np.random.default_rng(seed), ("burns",), 100.0, 900.0, np.array([20.0, 0.01]))
    assert 1 <= len(found.burns) <= 4
    for burn in found.burns:
        size = np.linalg.norm(burn.acceleration)
        assert 100 <= burn.start <= 1000
        assert 1 <= burn.length <= 60
        assert 0 < size <= 5e-3
        assert size * burn.length * (1000 - burn.start) < 0.2 * 20 + 1e-9


def test_pulses_come_in_order_within_the_span():
    found = drawn(np.random.default_rng(3), ("pulses",), -50.0, 900.0, np.array([20.0, 0.01]))
    assert 0 < found.bit <= 2e-3
    assert found.pulse_times[0] >= -50
    assert found.pulse_times[-1] <= 850
    assert (np.diff(found.pulse_times) > 0).all()


def test_only_forces_that_are_named_are_drawn():
    assert drawn(np.random.default_rng(1), ("glint",), 0.0, 900.0, np.array([20.0, 0.01])) == Forces()
