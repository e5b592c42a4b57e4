"""Against Kepler's laws."""

import numpy as np
import pytest

from baryscope.models.orbit import Orbit
from baryscope.study.population.third.forces import MU
from baryscope.study.population.third.kepler import at_epoch, propagated

ORBIT = Orbit(1.2e7, 0.4, 0.9, 1.1, 2.0, 0.7, MU)


def test_energy_momentum_and_eccentricity_are_those_of_the_elements():
    r, v = np.split(at_epoch(ORBIT), 2)
    h = np.cross(r, v)
    towards = np.cross(v, h) / MU - r / np.linalg.norm(r)
    assert MU / (2 * MU / np.linalg.norm(r) - v @ v) == pytest.approx(ORBIT.semi_major_axis, rel=1e-13)
    assert np.linalg.norm(towards) == pytest.approx(ORBIT.eccentricity, rel=1e-12)
    assert h[2] / np.linalg.norm(h) == pytest.approx(np.cos(ORBIT.inclination), rel=1e-13)
    assert np.arctan2(h[0], -h[1]) == pytest.approx(ORBIT.raan, rel=1e-12)
    assert towards @ r / np.linalg.norm(towards) / np.linalg.norm(r) == pytest.approx(np.cos(0.7), rel=1e-12)


def test_a_period_leads_back_and_half_of_it_from_periapsis_to_apoapsis():
    a, e = 1.2e7, 0.4
    state = at_epoch(Orbit(a, e, 0.9, 1.1, 2.0, 0.0, MU))
    period = 2 * np.pi * np.sqrt(a**3 / MU)
    half, whole, back = propagated(state, MU, period * np.array([0.5, 3.0, -1.0]))
    assert half[:3] == pytest.approx(-state[:3] * (1 + e) / (1 - e), rel=1e-11)
    assert half[3:] == pytest.approx(-state[3:] * (1 - e) / (1 + e), rel=1e-11)
    for again in (whole, back):
        np.testing.assert_allclose(again, state, rtol=1e-11, atol=1e-4)  # 2 π · 3 rounded, times 1e7 m


def test_the_true_anomaly_after_a_time_is_that_of_keplers_equation():
    a, e = 1.2e7, 0.4
    eccentric = 2.1  # rad
    time = (eccentric - e * np.sin(eccentric)) * np.sqrt(a**3 / MU)
    state = propagated(at_epoch(Orbit(a, e, 0.0, mu := 0.0, mu, mu, MU)), MU, np.array([time]))[0]
    expected = a * np.array([np.cos(eccentric) - e, np.sqrt(1 - e**2) * np.sin(eccentric), 0.0])
    np.testing.assert_allclose(state[:3], expected, atol=1e-5)
