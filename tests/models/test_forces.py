"""Drag, sunlight and eddy currents: closed forms of what each of them does by itself."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from baryscope.models.forces import (
    SUN_HALF_ANGLE,
    Atmosphere,
    Sunlight,
    dipole_field,
    drag,
    eddy_current_torque,
    sunlit_share,
)
from baryscope.models.orbit import EARTH_RADIUS

R = EARTH_RADIUS


def number(expression):
    return np.array(ca.evalf(expression)).ravel()


def test_drag_opposes_the_motion_through_an_air_that_turns():
    """−½ ρ b w² along w: at the equator, with the rotation and across it; a scale height up there is 1/e of it."""
    air = Atmosphere(ca.SX(2e-12), ca.SX(7e6), ca.SX(5e4), ca.SX(7e-5))
    found = number(drag(ca.SX([7e6, 0, 0]), ca.SX([0, 7500, 300]), air, ca.SX(0.01)))
    wind = np.array([0.0, 7500 - 490, 300])
    assert found == pytest.approx(-0.5 * 2e-12 * 0.01 * np.linalg.norm(wind) * wind, rel=1e-14)
    up = number(drag(ca.SX([0, 0, 7.05e6]), ca.SX([7500, 0, 0]), air, ca.SX(0.01)))
    assert up == pytest.approx([-0.5 * 2e-12 / np.e * 0.01 * 7500**2, 0, 0], rel=1e-12)


def share(place, sun=(1.0, 0.0, 0.0)):
    return number(sunlit_share(ca.SX(list(place)), Sunlight(ca.SX(list(sun)), ca.SX(1), ca.SX(R)))).item()


@pytest.mark.parametrize("radius, beta", [(6.8e6, 0.0), (7.15e6, 0.6), (4.2164e7, 0.05)])
def test_the_part_of_an_orbit_in_shadow(radius, beta):
    """Of a circular orbit, arccos(√(1 − R²/a²)/cos β)/π lies in a cylinder's shadow; penumbra adds as much as it takes.

    β is the angle between the Sun and the orbit's plane. The cone's half-angle of 4.65 mrad is left out: over a shadow
    of some length it matters to the square.
    """
    angles = np.linspace(0, 2 * np.pi, 40_001)[:-1]
    places = radius * np.array([np.cos(angles) * np.cos(beta), np.sin(angles), np.cos(angles) * np.sin(beta)])
    f = ca.Function("share", [r := ca.SX.sym("r", 3)], [
        sunlit_share(r, Sunlight(ca.SX([1, 0, 0]), ca.SX(1), ca.SX(R)))
    ])  # fmt: skip
    dark = 1 - np.array(f.map(len(angles))(places)).mean()
    assert dark == pytest.approx(np.arccos(np.sqrt(1 - (R / radius) ** 2) / np.cos(beta)) / np.pi, abs=1e-4)


def test_the_penumbra_is_where_two_circles_overlap():
    """The overlap of the discs in full (Montenbruck, Gill 2000, §3.4.2), at 20 places through the penumbra."""
    radius = 7e6
    a, b = SUN_HALF_ANGLE, np.arcsin(R / radius)
    for c in np.linspace(b - 0.99 * a, b + 0.99 * a, 20):
        x = (c * c + a * a - b * b) / (2 * c)
        y = np.sqrt(a * a - x * x)
        hidden = a * a * np.arccos(x / a) + b * b * np.arccos((c - x) / b) - c * y
        found = share([-radius * np.cos(c), radius * np.sin(c), 0.0])
        assert found == pytest.approx(1 - hidden / (np.pi * a * a), abs=0.01)
    assert share([-radius * np.cos(b - 1.01 * a), radius * np.sin(b - 1.01 * a), 0]) == pytest.approx(0, abs=1e-12)
    assert share([-radius * np.cos(b + 1.01 * a), radius * np.sin(b + 1.01 * a), 0]) == pytest.approx(1, abs=1e-12)
    assert [share([radius, 0, 0]), share([-radius, 0, 0])] == pytest.approx([1, 0], abs=1e-12)


@pytest.mark.parametrize("place", [[7e6, 0, 0], [-7e6, 0, 0], [-3e6, 6.3e6, 0]])
def test_the_derivatives_of_light_are_finite(place):
    r = ca.SX.sym("r", 3)
    light = Sunlight(ca.SX([1, 0, 0]), ca.SX(1), ca.SX(R))
    slope = ca.Function("slope", [r], [ca.jacobian(sunlit_share(r, light), r)])
    assert np.isfinite(np.array(slope(place))).all()


def test_the_field_of_a_dipole():
    """On the axis 2m/r³ along m, at the equator −m/r³; no source anywhere."""
    m = ca.SX([0, 0, 8e15])
    assert number(dipole_field(ca.SX([0, 0, 7e6]), m)) == pytest.approx([0, 0, 16e15 / 7e6**3])
    assert number(dipole_field(ca.SX([7e6, 0, 0]), m)) == pytest.approx([0, 0, -8e15 / 7e6**3])
    r = ca.SX.sym("r", 3)
    slope = np.array(ca.Function("s", [r], [ca.jacobian(dipole_field(r, m), r)])([3e6, -4e6, 5e6]))
    assert abs(np.trace(slope)) < 1e-14 * np.abs(slope).max()
    assert np.abs(slope - slope.T).max() < 1e-14 * np.abs(slope).max()  # no current either


def test_a_sphere_in_a_uniform_field_slows_down_exponentially():
    """Across the field ω falls as exp(−M B² t/J), along it not at all."""
    w, M, B, J = ca.SX.sym("w", 3), 3e5, 4e-5, 40.0
    torque = ca.Function("t", [w], [eddy_current_torque(M * ca.SX.eye(3), w, ca.SX([0, 0, B]), ca.SX.zeros(3))])
    start, tau = np.array([0.02, -0.05, 0.03]), J / (M * B * B)
    solution = solve_ivp(lambda _, w: np.array(torque(w)).ravel() / J, (0, 2 * tau), start, rtol=1e-10, atol=1e-14)
    assert solution.y[:, -1] == pytest.approx(start * [np.exp(-2), np.exp(-2), 1], rel=1e-7)


def test_a_body_that_turns_with_the_field_feels_no_torque():
    """The field turns at Ω: Ḃ = Ω × B; so does the body."""
    B, spin = np.array([1e-5, 2e-5, -3e-5]), np.array([1e-3, -2e-3, 5e-4])
    tensor = ca.SX(np.diag([1e6, 2e6, 3e6]))
    torque = number(eddy_current_torque(tensor, ca.SX(spin), ca.SX(B), ca.SX(np.cross(spin, B))))
    assert np.abs(torque).max() < 1e-20
