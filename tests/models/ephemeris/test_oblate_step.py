"""The steps under J2 that the online estimator takes, against two bodies that fall by a gravity written down again."""

from itertools import pairwise

import numpy as np
import pytest

from baryscope.models.ephemeris.oblate_step import oblate_functions
from baryscope.models.orbit import EARTH_J2, EARTH_MU, EARTH_RADIUS, Orbit
from oracles import fallen, inertial_states

OBLATE, TARGET_PLACE, OSCULATING = oblate_functions()
BODY = [EARTH_MU, EARTH_J2, EARTH_RADIUS]
ARC = 0.025  # rad, of a step of the filter at periapsis
CHASER = np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01])


def stepped(orbit, seen, time):
    """Places and states (n, 6) at times (n,) from 0, and the transition (6, 6) to the last one."""
    place = np.asarray(TARGET_PLACE(0.0, orbit.elements)).ravel()
    places, states, transition = [place], [seen], np.eye(6)
    for begin, end in pairwise(time):
        count = int(np.ceil((end - begin) * orbit.periapsis_rate / ARC))
        for _ in range(count):
            place, seen, step = (np.asarray(one) for one in OBLATE((end - begin) / count, BODY, place, seen))
            transition = step @ transition
        places.append(place.ravel())
        states.append(seen.ravel())
    return np.array(places), np.array(states), transition


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.7])
def test_an_orbit_by_steps_is_that_of_two_falling_bodies(eccentricity):
    """To 2e-7 of the distance after an orbit, a ten-thousandth of what J2 moves the one from the other."""
    orbit = Orbit(7.2e6 / (1 - eccentricity), eccentricity, 1.7, 0.3, 0.7, 0.4)
    time = np.linspace(0, orbit.period, 30)
    truth, plain = (fallen(orbit, *CHASER, time, **more) for more in ({}, {"gravity": _point_mass}))
    _, states, _ = stepped(orbit, truth[0], time)
    apart = np.linalg.norm((states - truth)[:, :3], axis=1)
    assert apart.max() < 2e-7 * np.linalg.norm(truth[:, :3], axis=1).max()
    assert np.linalg.norm((plain - truth)[:, :3], axis=1).max() > 1e4 * apart.max()


def _point_mass(position):
    return -EARTH_MU * position / np.linalg.norm(position) ** 3


def test_the_transition_is_the_derivative_of_the_state():
    orbit = Orbit(7.2e6, 0.05, 1.7, 0.3, 0.7, 0.4)
    time, seen = np.linspace(0, 3000.0, 7), fallen(orbit, *CHASER, np.array([0.0, 1.0]))[0]
    _, states, transition = stepped(orbit, seen, time)
    size = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])
    for k in range(6):
        change = size[k] * np.eye(6)[k]
        ends = [stepped(orbit, seen + sign * change, time)[1][-1] for sign in (1, -1)]
        np.testing.assert_allclose((ends[0] - ends[1]) / (2 * size[k]), transition[:, k], rtol=1e-6, atol=1e-6)
    assert np.isfinite(states).all()


@pytest.mark.parametrize(
    "elements",
    [
        (9000e3, 0.2, 1.1, 0.5, 0.8, 2.0),
        (7000e3, 0.0, 1.1, 0.5, 0.0, 2.0),
        (9000e3, 0.2, 0.0, 0.0, 0.8, 2.0),
        (42164e3, 0.0, 0.0, 0.0, 0.0, 6.0),
        (30000e3, 0.75, 2.9, 5.5, 3.8, 3.0),
    ],
)
@pytest.mark.parametrize("time", [0.0, 5000.0, -1e5])
def test_elements_of_a_place_give_the_place_again(elements, time):
    """Also where the elements define no direction; and a place at another time is on the same ellipse."""
    orbit = Orbit(*elements)
    place = np.asarray(TARGET_PLACE(time, orbit.elements)).ravel()
    again = np.asarray(OSCULATING(time, place, EARTH_MU)).ravel()
    for at in (time, 0.0, time + 777.0):
        there, expected = (np.asarray(TARGET_PLACE(at, one)).ravel() for one in (again, orbit.elements))
        np.testing.assert_allclose(there[:3], expected[:3], atol=1e-3)
        np.testing.assert_allclose(there[3:], expected[3:], atol=1e-6)
    start, _ = inertial_states(orbit, np.zeros(3), np.zeros(3))
    at_zero = np.asarray(TARGET_PLACE(0.0, orbit.elements)).ravel()
    np.testing.assert_allclose(at_zero, np.concatenate(start), rtol=1e-9, atol=1e-6)
