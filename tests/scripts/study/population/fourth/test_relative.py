"""The path against Kepler's orbits in extended precision, and the oblate Earth against its secular rate."""

import numpy as np
import pytest

from baryscope.models.orbit import Orbit
from baryscope.study.population.fourth.orbits import EQUATORIAL_RADIUS, J2, MU, state
from baryscope.study.population.fourth.relative import carried, flown, path_jacobian
from oracles import inertial_states, propagate_kepler

TIME = np.linspace(0, 12000, 13)  # s
CHASER = np.array([20.0, -15.0, 8.0, 0.01, -0.02, 0.015])


def orbit_of(eccentricity):
    return Orbit(7e6 / (1 - eccentricity), eccentricity, 1.0, 0.3, 0.2, 0.7, MU)


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.7])
def test_the_path_is_the_difference_of_two_kepler_orbits(eccentricity):
    orbit = orbit_of(eccentricity)
    target = state(orbit, 0.0)
    _, found = flown(target, CHASER[None], 0.0, TIME, False)
    ends = target[:3], target[3:]
    other = target[:3] + CHASER[:3], target[3:] + CHASER[3:]
    for k, t in enumerate(TIME):
        expected = propagate_kepler(*other, MU, t)[0] - propagate_kepler(*ends, MU, t)[0]
        # 1e-9 m of the rounding of the chaser's place, 1e-12 m/s of its velocity, which drifts for 1e4 s
        np.testing.assert_allclose(found[k, 0, :3], expected.astype(float), atol=1e-6)


@pytest.mark.parametrize("time", [-1500.0, 4000.0, 1e5])
def test_the_target_is_where_its_elements_say(time):
    orbit = orbit_of(0.3)
    target, _ = inertial_states(orbit, np.zeros(3), np.zeros(3))
    expected = np.concatenate(propagate_kepler(*target, MU, time)).astype(float)
    np.testing.assert_allclose(state(orbit, time), expected, rtol=1e-9, atol=1e-3)  # 1e5 s are 80 rad: 1e-14 of them
    if abs(time) < 1e4:
        np.testing.assert_allclose(carried(state(orbit, 0.0), time, False), expected, rtol=1e-9, atol=1e-3)


def test_an_oblate_earth_turns_the_node_at_its_secular_rate():
    orbit = orbit_of(0.01)
    a, e = orbit.semi_major_axis, orbit.eccentricity
    revolutions = 2 * np.pi * np.sqrt(a**3 / MU) * np.arange(16)
    states, _ = flown(state(orbit, 0.0), CHASER[None], 0.0, revolutions, True)
    h = np.cross(states[:, :3], states[:, 3:])
    found = np.polyfit(revolutions, np.unwrap(np.arctan2(h[:, 0], -h[:, 1])), 1)[0]
    expected = -1.5 * J2 * (EQUATORIAL_RADIUS / a / (1 - e**2)) ** 2 * np.sqrt(MU / a**3) * np.cos(orbit.inclination)
    assert found == pytest.approx(expected, rel=0.01)  # of the order of J2 · 1.5, and of the short periods that drift


def test_a_chaser_far_away_flies_as_a_target_there():
    """Encke's difference beside two orbits by themselves, with J2, to the rounding of these."""
    target = state(orbit_of(0.1), 0.0)
    far = 1e3 * CHASER
    ends, found = flown(target, far[None], 0.0, TIME, True)
    alone, _ = flown(target + far, np.zeros((0, 6)), 0.0, TIME, True)
    np.testing.assert_allclose(found[:, 0], alone - ends, rtol=1e-7, atol=1e-3)


@pytest.mark.parametrize("oblate", [False, True])
def test_the_jacobian_is_how_the_path_depends_on_the_chaser(oblate):
    target, change = state(orbit_of(0.1), 0.0), np.array([1.0, -2.0, 0.5, 1e-3, 5e-4, -2e-3])
    _, found = flown(target, np.stack([CHASER, CHASER + change]), 0.0, TIME, oblate)
    jacobian = path_jacobian(target, CHASER, 0.0, TIME, oblate)
    np.testing.assert_allclose(jacobian[0], -np.eye(3, 6), atol=1e-9)
    np.testing.assert_allclose(jacobian @ change, (found[:, 0] - found[:, 1])[:, :3], atol=1e-3)  # 100 m² / 7e6 m
