"""What noise after the last observation adds: closed forms, and integrals over independently integrated responses."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.dynamics.growth import path_growth, rotation_growth
from baryscope.estimator.dynamics.paths import Polynomial
from baryscope.estimator.dynamics.relative_motion import RelativeOrbit
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_transition
from free_paths import RATE
from oracles import propagate_kepler
from synthetic import ENVISAT, MU, attitude

DENSITY, END = 3e-6, 100.0
ORBIT = Orbit(7150e3, 0.0, 0.0)  # a circle in the plane z = 0, from the x axis


def test_a_path_without_forces_has_the_closed_form():
    ahead = np.array([0.5, 20.0, 300.0])
    found = path_growth(Polynomial(1, 0.0, END), DENSITY, END, np.concatenate([[50.0, END], END + ahead]))
    assert not found[:2].any()
    for T, covariance in zip(ahead, found[2:], strict=True):
        of_an_axis = DENSITY * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
        np.testing.assert_allclose(covariance, np.kron(of_an_axis, np.eye(3)), rtol=1e-12)


def test_on_an_orbit_it_is_the_integral_of_responses_to_pushes():
    """Each response is the difference of two Kepler orbits, one of which is pushed by 1 mm/s."""
    orbit = RelativeOrbit(ORBIT, 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    T = 1500.0
    pushed = END + (nodes + 1) / 2 * T
    radius = ORBIT.semi_major_axis
    r0, v0 = np.array([radius, 0, 0]), np.array([0, 1, 0]) * np.sqrt(MU / radius)
    expected = np.zeros((6, 6))
    for s, weight in zip(pushed, weights * T / 2, strict=True):
        r, v = (np.array(z, dtype=np.longdouble) for z in propagate_kepler(r0, v0, MU, np.longdouble(s)))
        end = np.concatenate(propagate_kepler(r, v, MU, np.longdouble(END + T - s)))
        for axis in np.eye(3):
            other = np.concatenate(propagate_kepler(r, v + 1e-3 * axis, MU, np.longdouble(END + T - s)))
            response = ((other - end) / 1e-3).astype(float)
            expected += DENSITY * weight * np.outer(response, response)
    found = path_growth(orbit, DENSITY, END, np.array([END + T]))[0]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=5e-4)


def test_from_apoapsis_to_apoapsis_the_steps_are_those_of_the_periapsis():
    """tr P = q ∫ ‖∂r/∂v‖² ds, by Yamanaka and Ankersen's closed form, in which ‖∂r/∂v‖ is the same as in LVLH."""
    orbit = Orbit(26e6, 0.7, 1.0, true_anomaly=np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0.0, orbit.period, 61)
    pushed = (edges[:-1, None] + (nodes + 1) / 2 * edges[1]).ravel()
    T = orbit.period
    responses = [relative_transition(orbit, np.array([T]), s)[0, :3, 3:] for s in pushed]
    sizes = np.array([np.sum(response**2) for response in responses])
    expected = DENSITY * np.sum(np.tile(weights, 60) * sizes) * edges[1] / 2
    found = path_growth(RelativeOrbit(orbit, 0.0), DENSITY, 0.0, np.array([T]))[0]
    assert np.trace(found[:3, :3]) == pytest.approx(expected, rel=0.02)


def test_of_a_rotation_it_is_the_integral_of_responses_to_kicks():
    """Each response is a difference of two integrations by scipy, one of which has another rate."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    T, kick = 20.0, 1e-6

    def flown(rate, span):
        def slope(_, w):
            return np.linalg.solve(ENVISAT, -np.cross(w, ENVISAT @ w))

        end = solve_ivp(slope, (0, span), rate, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        return attitude(ENVISAT, rate, np.array([0.0, span]))[-1], end

    expected = np.zeros((6, 6))
    for s, weight in zip((nodes + 1) / 2 * T, weights * T / 2, strict=True):
        rate = flown(RATE, END + s)[1]
        R, end = flown(rate, T - s)
        for axis in np.eye(3):
            R_kicked, end_kicked = flown(rate + kick * axis, T - s)
            turn = ScipyRotation.from_matrix(R.T @ R_kicked).as_rotvec()
            response = np.concatenate([turn, end_kicked - end]) / kick
            expected += DENSITY * weight * np.outer(response, response)
    found = rotation_growth(Rotation(0.0, np.eye(3), RATE, ENVISAT), DENSITY, END, np.array([END + T]))[0]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-3)
