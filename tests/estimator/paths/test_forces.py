"""Paths under known and constant accelerations, against two orbits integrated with them by scipy."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from baryscope.estimator.options import PathOptions
from baryscope.estimator.paths.extended_path import factors_of
from baryscope.estimator.paths.forces import ForcedPath, PushedPath, constant_of, lasting, untold_firings
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from baryscope.estimator.paths.relative_motion import PerturbedOrbit, RelativeOrbit
from baryscope.estimator.paths.trajectory import chosen_path
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.ephemeris.sun import sun_direction
from baryscope.models.ephemeris.utc import utc_of
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from baryscope.models.orbit import Orbit as OrbitOfTarget
from oracles import inertial_states, oblate_gravity
from synthetic import Orbit

START = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))
OBLATE = replace(
    Orbit(semi_major_axis=7.3e6, eccentricity=0.01).model(), j2=EARTH_J2, equatorial_radius=EARTH_RADIUS,
    epoch="2026-03-01T12:00:00Z",
)  # fmt: skip
TIME = np.linspace(1, 2399, 25)


def flown(on_chaser, jumps, on_target=lambda t, r, v: np.zeros(3)):
    """The CoM seen from the chaser at TIME, with accelerations (t, target's r and v) → (3,) that jump."""
    target, chaser = inertial_states(OBLATE, *START)
    state, found = np.concatenate([*target, *chaser]), []

    def slope(t, s, now):
        return np.concatenate(
            [
                s[3:6], oblate_gravity(s[:3]) + on_target(t, s[:3], s[3:6]),
                s[9:], oblate_gravity(s[6:9]) + on_chaser(t, now, s[:3], s[3:6]),
            ]
        )  # fmt: skip

    edges = [0.0, *jumps, 2400.0]
    for begin, end in pairwise(edges):
        wanted = TIME[(begin <= TIME) & (end > TIME)]
        middle = (begin + end) / 2
        solution = solve_ivp(
            slope, (begin, end), state, "DOP853", np.append(wanted, end), args=(middle,), rtol=1e-13, atol=1e-6
        )
        found.append(solution.y[:, :-1])
        state = solution.y[:, -1]
    both = np.hstack(found)
    return (both[:3] - both[6:9]).T


def lvlh(r, v):
    up, normal = r / np.linalg.norm(r), np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    return np.stack([up, np.cross(normal, up), normal], axis=1)


@pytest.mark.parametrize("axes", ["inertial", "lvlh"])
def test_known_thrust_on_an_orbit(axes):
    """Up to 300 m off: exact there, too."""
    rows, values = np.array([100.0, 700.0, 1300.0]), 1e-3 * np.array([[0.3, -0.2, 0.1], [-0.1, 0.4, 0], [0, 0, 0]])
    known = KnownAcceleration(rows, values, axes)

    def thrust(t, now, r, v):
        row = np.searchsorted(rows, now, "right") - 1
        held = values[row] if row >= 0 else np.zeros(3)
        return lvlh(r, v) @ held if axes == "lvlh" else held

    expected = flown(thrust, rows)
    x = np.concatenate([START[0], START[1] / OBLATE.mean_motion])
    path = PerturbedOrbit(OBLATE, 0.0, known)
    np.testing.assert_allclose(path.at(TIME).position(x), expected, atol=1e-6)
    assert np.abs(expected - PerturbedOrbit(OBLATE, 0.0).at(TIME).position(x)).max() > 100
    ends = path.at(TIME + 0.01).position(x) - path.at(TIME - 0.01).position(x)
    np.testing.assert_allclose(path.rate_at(TIME).position(x)[1:-1], ends[1:-1] / 0.02, atol=3e-6)


@pytest.mark.parametrize("axes", ["lvlh", "inertial", "drag", "sun"])
def test_a_constant_acceleration(axes):
    """Fitted to the integrated path, a linear least squares finds it; the response is linear, so to 1e-4 of it."""
    if axes in ("lvlh", "inertial"):
        true = np.array([1e-6, -2e-6, 5e-7])

        def push(t, r, v):
            return lvlh(r, v) @ true if axes == "lvlh" else true
    elif axes == "drag":
        true = np.array([2e-6])

        def push(t, r, v):
            wind = np.array([v[0] + 7.2921159e-5 * r[1], v[1] - 7.2921159e-5 * r[0], v[2]])
            return -true[0] * wind / np.linalg.norm(wind)
    else:
        true = np.array([6e-7])
        towards = sun_direction(utc_of(OBLATE.epoch, "here"), np.zeros(1))[0]

        def push(t, r, v):
            behind = r @ towards < 0 and np.linalg.norm(r - (r @ towards) * towards) < EARTH_RADIUS
            return np.zeros(3) if behind else -true[0] * towards

    com = flown(lambda t, now, r, v: np.zeros(3), [], push)
    path = ForcedPath(PerturbedOrbit(OBLATE, 1200.0), constant_of(axes, OBLATE, 0.0, 2400.0), 0.0, 2400.0)
    sampled = path.at(TIME)
    x = np.zeros(path.size)
    for _ in range(4):
        left = (com - sampled.position(x)).ravel()
        x = x + np.linalg.lstsq(sampled.jacobian.reshape(-1, path.size), left, rcond=None)[0]
    found = [factor.value for factor in factors_of(path, x, np.eye(path.size))]
    # The integration's shadow has a sharp edge: some seconds of 2400.
    np.testing.assert_allclose(found, true, atol=(5e-3 if axes == "sun" else 1e-4) * np.abs(true).max())


def test_a_push_that_leads_far_is_exact_there():
    """150 m off, where the response to the gravity gradient alone is wrong, half of the time beyond the tracks."""
    push = 1e-4 * np.array([0.6, -0.64, 0.48])
    expected = flown(lambda t, now, r, v: -lvlh(r, v) @ push, [])
    motion, force = PerturbedOrbit(OBLATE, 0.0), constant_of("lvlh", OBLATE, -1200.0, 1200.0)
    path, linear = (kind(motion, force, -1200.0, 1200.0) for kind in (PushedPath, ForcedPath))
    x = np.concatenate([START[0], START[1] / OBLATE.mean_motion, push * path._displacement])
    assert np.linalg.norm(expected, axis=1).max() > 150
    np.testing.assert_allclose(path.at(TIME).position(x), expected, atol=2e-6)
    assert np.abs(linear.at(TIME).position(x) - expected).max() > 1e-4
    rate = path.at(TIME + 0.5).position(x) - path.at(TIME - 0.5).position(x)
    np.testing.assert_allclose(path.rate_at(TIME).position(x), rate, atol=1e-6)


def test_free_flight_with_thrust():
    """½ a t² from the middle of the time on, and the velocity a t."""
    known = KnownAcceleration([-1e3], [[2e-3, 0, -1e-3]])
    options = PathOptions(trajectory="polynomial:1", process_noise="none", acceleration=known)
    path, time = chosen_path(options, None, 0.0, 100.0), np.array([0.0, 50.0, 90.0])
    x = np.arange(6.0)
    base = Polynomial(1, 0.0, 100.0)
    expected = -np.outer((time - 50) ** 2 / 2, [2e-3, 0, -1e-3])
    np.testing.assert_allclose(path.at(time).position(x) - base.at(time).position(x), expected, atol=1e-12)
    np.testing.assert_allclose(path.at(time).offset, expected, atol=1e-12)
    expected = -np.outer(time - 50, [2e-3, 0, -1e-3])
    np.testing.assert_allclose(path.rate_at(time).position(x) - base.rate_at(time).position(x), expected, atol=1e-12)


def test_unknowns_are_displacements_with_the_priors_of_their_factors():
    known = KnownAcceleration([0.0, 300.0], [[1e-3, 0, 0], [0, 1e-3, 0]], scale=0.02, noise=1e-10)
    options = PathOptions(acceleration=known, constant_acceleration="lvlh")
    path = chosen_path(options, OBLATE, 0.0, 2400.0)
    assert isinstance(path, ProcessNoisePath)
    assert [one.lower for one in path.prior.hyperparameters] == [pytest.approx(np.log(1e-10))]
    assert path.base.size == 6 + 1 + 3
    columns = path.base.at(np.linspace(0, 2400, 65)).jacobian[:, :, 6:]
    np.testing.assert_allclose(np.sqrt(np.mean(np.sum(columns**2, axis=1), axis=0)), 1, rtol=1e-9)
    deviations = path.base.prior.precision(np.zeros(0))[6:] ** -0.5
    of_x = np.diag(np.concatenate([np.ones(6), deviations**2, np.ones(path.size - 10)]))
    factors = factors_of(path, np.zeros(path.size), of_x)
    assert [one.unit for one in factors] == ["1", "m/s²", "m/s²", "m/s²"]
    np.testing.assert_allclose([one.deviation for one in factors], [0.02, 1e-4, 1e-4, 1e-4])
    given = chosen_path(replace(options, process_noise=2e-10), OBLATE, 0.0, 2400.0)
    assert isinstance(given, ProcessNoisePath)
    assert given.density == pytest.approx(3e-10)


def test_errors_of_firings():
    """Each firing off by its own vector: to first order the columns explain it."""
    rows = np.array([100.0, 160.0, 900.0, 930.0])
    values = 1e-3 * np.array([[1.0, 0, 0.5], [0, 0, 0], [0, -2.0, 0], [0, 0, 0]])
    errors = np.array([[0.01, -0.02, 0.005], [0.0, 0.01, 0.02]])
    sizes = np.linalg.norm(values, axis=1)
    actual = values.copy()
    actual[[0, 2]] += sizes[[0, 2], None] * errors
    options = PathOptions(acceleration=KnownAcceleration(rows, values, "lvlh", firing=0.01), process_noise="none")
    path = chosen_path(options, OBLATE, 0.0, 2400.0)
    true = PerturbedOrbit(OBLATE, 1200.0, KnownAcceleration(rows, actual, "lvlh"))
    x = np.concatenate([[3.0, -20, 5, 1, -4, 2], errors.ravel() * path._displacement])
    change = np.abs(true.at(TIME).position(x[:6]) - path.base.at(TIME).position(x[:6])).max()
    assert change > 0.5
    np.testing.assert_allclose(path.at(TIME).position(x), true.at(TIME).position(x[:6]), atol=1e-4 * change)
    factors = factors_of(path, x, np.diag(np.concatenate([np.ones(6), path.prior.precision(np.zeros(0))[6:] ** -1])))
    np.testing.assert_allclose([one.value for one in factors], errors.ravel(), atol=1e-12)
    np.testing.assert_allclose([one.deviation for one in factors], 0.01)
    assert factors[3].name == "error of the firing from 900 s, x"


def test_firings_beyond_the_tracks_add_what_their_errors_do():
    """In free flight an error of a burn moves place and velocity by its double and single integral over the burn."""
    rows = [-50.0, -40.0, 90.0, 120.0, 200.0, 210.0]
    values = 1e-3 * np.array([[0, 3.0, 4.0], [0, 0, 0], [1.0, 0, 0], [0, 0, 0], [3.0, 0, -4.0], [0, 0, 0]])
    options = PathOptions("polynomial:1", acceleration=KnownAcceleration(rows, values, firing=0.1))
    path = chosen_path(replace(options, process_noise="none"), None, 0.0, 100.0)
    names = [one.name for one in factors_of(path, np.zeros(9), np.eye(9))]
    assert names == [f"error of the firing from 90 s, {axis}" for axis in "xyz"]
    moved = {-60.0: (150.0, -10.0), -30.0: (0, 0), 0.0: (0, 0), 100.0: (0, 0), 150.0: (0, 0), 205.0: (12.5, 5.0)}
    moved[300.0] = ((100**2 - 90**2) / 2, 10.0)
    found = untold_firings(path, 0.0, 100.0, np.array(list(moved)))
    size = 0.1 * 5e-3
    expected = [np.kron(size**2 * np.outer(one, one), np.eye(3)) for one in moved.values()]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_what_forces_need():
    with pytest.raises(InputError, match="constant_acceleration is sun, which needs the UTC of time 0"):
        constant_of("sun", replace(OBLATE, epoch=None), 0.0, 1.0)
    with pytest.raises(InputError, match="constant_acceleration is lvlh, which needs the target's orbit"):
        chosen_path(PathOptions(constant_acceleration="lvlh"), None, 0.0, 1.0)
    with pytest.raises(InputError, match="is 'wind', expected one of none, lvlh, inertial, drag, sun"):
        PathOptions(constant_acceleration="wind")


def test_what_lasts_is_uniform_acceleration_in_free_flight():
    time, begin, end = np.array([-20.0, 0.0, 5.0, 10.0, 40.0]), 0.0, 10.0
    found = lasting(Polynomial(1, begin, end), 4.0, begin, end, time)
    for away, one in zip([-20.0, 0.0, 0.0, 0.0, 30.0], found, strict=True):
        column = np.array([away**2 / 2, away])
        np.testing.assert_allclose(one, 4.0 * np.kron(np.outer(column, column), np.eye(3)), rtol=1e-12, atol=1e-12)


def test_what_lasts_on_a_circle_keeps_its_direction_in_inertial_axes_or_beside_the_orbit():
    """Half of the variance each: by an independent integration about a circle, and by Clohessy and Wiltshire.

    The latter as the sum of all squares for radial, along-track and cross-track accelerations (Alfriend 2010).
    """
    orbit, variance = OrbitOfTarget(7e6, 0.0, 1.0, 0.2, 0.3, 0.4), 1e-12
    n, end = orbit.mean_motion, 100.0
    tau = orbit.period * np.array([0.1, 0.7, 1.5])
    found = lasting(RelativeOrbit(orbit, end / 2), variance, 0.0, end, end + tau)
    R_C_L = lvlh_attitude(orbit, np.array([end]))[0]

    def slope(t, s):
        up = R_C_L @ [np.cos(n * t), np.sin(n * t), 0.0]
        gradient, z = n**2 * (3 * np.outer(up, up) - np.eye(3)), s.reshape(6, 3)
        return np.concatenate([z[3:], gradient @ z[:3] + np.eye(3)]).ravel()

    moved = solve_ivp(slope, (0, tau[-1]), np.zeros(18), "DOP853", tau, rtol=1e-11, atol=1e-9).y.T.reshape(-1, 6, 3)
    beside = found - variance / 2 * moved @ np.swapaxes(moved, 1, 2)
    wave, rest = (1 - np.cos(n * tau)) / n**2, (n * tau - np.sin(n * tau)) / n**2
    along = 4 * wave - 1.5 * tau**2
    expected = variance / 2 * (2 * wave**2 + 8 * rest**2 + along**2)
    np.testing.assert_allclose(np.trace(beside[:, :3, :3], axis1=1, axis2=2), expected, rtol=1e-6)
    # Both halves move the target across the orbit's plane alike: that matrix is singular.
    squares = [np.diag(by.T @ np.linalg.lstsq(of, by)[0]) for by, of in zip(moved[1:], found[1:], strict=True)]
    assert np.max(squares) < 2 / variance * (1 + 1e-6)  # of 1 m/s²: what keeps its direction is not beyond the claim
