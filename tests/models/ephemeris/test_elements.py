"""Elements of a state that is made of elements by rotations, also where they define no direction."""

import numpy as np
import pytest

from baryscope.models.ephemeris import elements_of
from baryscope.models.orbit import EARTH_MU, Orbit
from oracles import inertial_states

GIVEN = {
    "inclined ellipse": (9000e3, 0.2, 1.1, 0.5, 0.8, 2.0),
    "retrograde": (9000e3, 0.2, 2.9, 5.5, 3.8, 4.0),
    "circle, from its node": (7000e3, 0.0, 1.1, 0.5, 0.0, 2.0),
    "equatorial, from the x axis": (9000e3, 0.2, 0.0, 0.0, 0.8, 2.0),
}


@pytest.mark.parametrize("kind", GIVEN)
def test_elements_are_those_of_the_state(kind):
    orbit = Orbit(*GIVEN[kind])
    state, _ = inertial_states(orbit, np.zeros(3), np.zeros(3))
    found = Orbit(**elements_of(np.concatenate(state), EARTH_MU))
    np.testing.assert_allclose(found.elements[:3], orbit.elements[:3], rtol=1e-10, atol=1e-9)
    apart = np.subtract(found.elements[3:6], orbit.elements[3:6])
    np.testing.assert_allclose(np.exp(1j * apart), 1.0, atol=1e-9)  # angles, by whole turns
