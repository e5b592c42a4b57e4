"""LVLH axes along an orbit, from position and velocity on an independent Kepler orbit."""

import numpy as np
import pytest

import oracles
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit


@pytest.mark.parametrize("eccentricity", [0.0, 0.05, 0.2])
def test_lvlh_axes(eccentricity):
    orbit = Orbit(
        semi_major_axis=9.0e6,
        eccentricity=eccentricity,
        inclination=1.72,
        raan=2.1,
        argument_of_periapsis=1.6,
        true_anomaly=3.5,
    )
    time = np.linspace(-5000.0, 20_000.0, 26)
    R_I_L = lvlh_attitude(orbit, time)
    assert R_I_L.shape == (26, 3, 3)

    start, _ = oracles.inertial_states(orbit, np.zeros(3), np.zeros(3))
    for R, t in zip(R_I_L, time, strict=True):
        r, v = (np.asarray(a, dtype=float) for a in oracles.propagate_kepler(*start, orbit.gravitational_parameter, t))
        normal = np.cross(r, v)
        np.testing.assert_allclose(R[:, 0], r / np.linalg.norm(r), atol=1e-11)
        np.testing.assert_allclose(R[:, 2], normal / np.linalg.norm(normal), atol=1e-11)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1)
