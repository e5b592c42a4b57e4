"""What noise beyond the observations adds: closed forms, and integrals over independently integrated responses."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation as ScipyRotation

from baryscope.estimator.dynamics.growth import MOST_TURNED, path_growth, rotation_growth
from baryscope.estimator.dynamics.rotation import Rotation
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_transition
from free_paths import RATE
from oracles import propagate_kepler
from synthetic import ENVISAT, MU, attitude

DENSITY, END = 3e-6, 100.0
TORQUE = 1e-10  # rad²/s³: of a rotation, which a greater density turns by more than is linear
ORBIT = Orbit(7150e3, 0.0, 0.0)  # a circle in the plane z = 0, from the x axis


def test_a_path_without_forces_has_the_closed_form():
    away = np.array([0.5, 20.0, 300.0])
    time = np.concatenate([[0.0, 50.0, END], END + away, -away])
    found = path_growth(Polynomial(1, 0.0, END), DENSITY, 0.0, END, time)
    assert not found[:3].any()
    for sign, covariances in ((1, found[3:6]), (-1, found[6:])):
        for T, covariance in zip(away, covariances, strict=True):
            of_an_axis = DENSITY * np.array([[T**3 / 3, sign * T**2 / 2], [sign * T**2 / 2, T]])
            np.testing.assert_allclose(covariance, np.kron(of_an_axis, np.eye(3)), rtol=1e-12)


@pytest.mark.parametrize("time", [3e9, -3e9])
def test_times_that_take_too_many_steps_are_refused(time):
    """A million of them, each a twentieth of 1/(6^¼ n), n² 6^½ the norm of the gravity gradient diag(2, −1, −1) n²."""
    most = 1e6 * 0.05 / (6**0.25 * np.sqrt(MU / 7150e3**3))
    with pytest.raises(
        ComputationError, match=re.escape(f"found 3e+09 s away from the tracks, expected {most:.3g} s")
    ) as caught:
        path_growth(RelativeOrbit(ORBIT, 0.0), DENSITY, 0.0, END, np.array([50.0, time]))
    assert caught.value.reason is Reason.TOO_LONG


@pytest.mark.parametrize("T", [1500.0, -1500.0])
def test_on_an_orbit_it_is_the_integral_of_responses_to_pushes(T):
    """Each response is the difference of two Kepler orbits, one of which is pushed by 1 mm/s; ahead and back."""
    orbit = RelativeOrbit(ORBIT, 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    origin = END if T > 0 else 0.0
    pushed = origin + (nodes + 1) / 2 * T
    radius = ORBIT.semi_major_axis
    r0, v0 = np.array([radius, 0, 0]), np.array([0, 1, 0]) * np.sqrt(MU / radius)
    expected = np.zeros((6, 6))
    for s, weight in zip(pushed, weights * abs(T) / 2, strict=True):
        r, v = (np.array(z, dtype=np.longdouble) for z in propagate_kepler(r0, v0, MU, np.longdouble(s)))
        end = np.concatenate(propagate_kepler(r, v, MU, np.longdouble(origin + T - s)))
        for axis in np.eye(3):
            other = np.concatenate(propagate_kepler(r, v + 1e-3 * axis, MU, np.longdouble(origin + T - s)))
            response = ((other - end) / 1e-3).astype(float)
            expected += DENSITY * weight * np.outer(response, response)
    found = path_growth(orbit, DENSITY, 0.0, END, np.array([origin + T]))[0]
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
    found = path_growth(RelativeOrbit(orbit, 0.0), DENSITY, -1.0, 0.0, np.array([T]))[0]
    assert np.trace(found[:3, :3]) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("T", [20.0, -20.0])
def test_of_a_rotation_it_is_the_integral_of_responses_to_kicks(T):
    """Each response is a difference of two integrations by scipy, one of which has another rate; ahead and back."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    origin, kick = END if T > 0 else 0.0, 1e-6

    def flown(rate, span):
        def slope(_, w):
            return np.linalg.solve(ENVISAT, -np.cross(w, ENVISAT @ w))

        end = solve_ivp(slope, (0, span), rate, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        return attitude(ENVISAT, rate, np.array([0.0, span]))[-1], end

    expected = np.zeros((6, 6))
    for s, weight in zip((nodes + 1) / 2 * T, weights * abs(T) / 2, strict=True):
        rate = flown(RATE, origin + s)[1]
        R, end = flown(rate, T - s)
        for axis in np.eye(3):
            R_kicked, end_kicked = flown(rate + kick * axis, T - s)
            turn = ScipyRotation.from_matrix(R.T @ R_kicked).as_rotvec()
            response = np.concatenate([turn, end_kicked - end]) / kick
            expected += TORQUE * weight * np.outer(response, response)
    rotation = Rotation(0.0, np.eye(3), RATE, ENVISAT)
    motion, time = rotation.at(np.array([0.0, END, origin + T])), np.array([origin + T])
    found = rotation_growth(rotation, motion, TORQUE, 0.0, END, time)[0]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-4)


def test_the_gravity_gradient_turns_what_the_noise_has_caused():
    """Over a tenth of an orbit: the integral of the sensitivities of motions that begin at many times."""
    origin, T = 0.0, 600.0
    rotation = Rotation(origin, np.eye(3), RATE / 20, ENVISAT, ORBIT)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    expected = np.zeros((6, 6))
    pushed = origin + (nodes + 1) / 2 * T
    states = rotation.at(pushed)
    for s, R, rate, weight in zip(pushed, states.attitude, states.rate, weights * T / 2, strict=True):
        end = Rotation(float(s), R, rate, ENVISAT, ORBIT).at(np.array([origin + T]))
        response = np.concatenate([end.turn[0, :, :3], end.rate_sensitivity[0, :, :3]])
        expected += TORQUE * weight * response @ response.T
    found, free = (
        rotation_growth(one, one.at(np.array([-1.0, T])), TORQUE, -1.0, origin, np.array([origin + T]))[0]
        for one in (rotation, replace(rotation, orbit=None))
    )
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-4)
    assert abs(np.trace(free) / np.trace(found) - 1) > 0.01  # it makes a difference


def test_about_the_axis_of_middle_inertia_it_grows_until_nothing_is_known_of_the_attitude():
    """What changes the rate by 3e-12 rad/s in a second is e times as much every three seconds, for 400 of them."""
    inertia = np.diag([0.05, 0.42, 0.53])
    rotation = Rotation(0.0, np.eye(3), np.array([0.0, 0.25, 0.0]), inertia)
    time = np.array([1.0, 10.0, 50.0, 150.0, 400.0])
    found = rotation_growth(rotation, rotation.at(time), 1e-23, -1.0, 0.0, time)
    of_turn = np.trace(found[:, :3, :3], axis1=1, axis2=2)
    np.testing.assert_allclose(of_turn[-2:], MOST_TURNED, rtol=1e-12)
    assert of_turn[2] < 1e-6
    scale = np.sqrt(np.diagonal(found, axis1=1, axis2=2))
    assert np.linalg.eigvalsh(found / scale[:, :, None] / scale[:, None, :]).min() > -1e-9
