"""The path against the difference of two Kepler orbits, and forces against closed forms."""

from decimal import Decimal, getcontext

import numpy as np
import pytest

from baryscope.models.orbit import Orbit
from baryscope.study.population.third.forces import EARTH_RADIUS, J2, MU, Burn, Forces
from baryscope.study.population.third.kepler import at_epoch, propagated
from baryscope.study.population.third.relative import carried, difference, flown

LOW, HIGH = Orbit(6.9e6, 0.01, 1.0, 0.3, 0.2, 0.1, MU), Orbit(42164e3, 0.001, 0.1, 0.3, 0.2, 0.1, MU)
START = np.array([20.0, -15.0, 8.0, 0.01, -0.02, 0.015])
ROUNDED = 1e-7  # m, of the difference of two positions of 7e6 m some radians on


def fly(orbit=LOW, start=START, time=None, forces=None, seed=1):
    time = np.linspace(0, 12000, 60) if time is None else time
    return flown(at_epoch(orbit), start, time, forces or Forces(), np.random.default_rng(seed))


def by_kepler(orbit, start, elapsed):
    target = at_epoch(orbit)
    return propagated(target, MU, elapsed) - propagated(target - start, MU, elapsed)


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.7])
def test_without_forces_the_path_is_the_difference_of_two_kepler_orbits(eccentricity):
    orbit = Orbit(7e6 / (1 - eccentricity), eccentricity, 1.0, 0.3, 0.2, 0.1, MU)
    time = np.linspace(0, 12000, 60)
    expected = by_kepler(orbit, START, time)
    np.testing.assert_allclose(fly(orbit).path, expected[:, :3], atol=ROUNDED * 5)
    np.testing.assert_allclose(fly(orbit).velocity, expected[:, 3:], atol=ROUNDED * 5e-3)


def test_the_difference_of_attractions_loses_no_digits():
    getcontext().prec = 50
    r, p = np.array([5.1e6, -3.2e6, 3.7e6]), np.array([1e-3, 2e-3, -3e-3])

    def pull(x):
        squared = sum(part * part for part in x)
        return [-Decimal(MU) * part / (squared * squared.sqrt()) for part in x]

    exact = [Decimal(part) for part in r.tolist()]
    near = [one - Decimal(other) for one, other in zip(exact, p.tolist(), strict=True)]
    expected = [float(one - other) for one, other in zip(pull(exact), pull(near), strict=True)]
    np.testing.assert_allclose(difference(r, p), expected, rtol=1e-6)  # r − p is rounded to 1e-9 m of 4e-3 m


def test_the_transition_is_how_the_path_depends_on_its_start():
    step = 1e-2
    time = np.linspace(0, 6000, 20)
    found = fly(time=time).transition
    for k in range(6):
        change = np.zeros(6)
        change[k] = step if k < 3 else step * 1e-3
        up, down = (by_kepler(LOW, START + sign * change, time) for sign in (1, -1))
        expected = (up - down) / (2 * change[k])
        scale = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(found[:, :, k] / scale, expected / scale, atol=1e-5)  # 1e-8 m over 1e-3 m


def test_j2_turns_the_node_at_its_secular_rate():
    revolutions = 2 * np.pi * np.sqrt(LOW.semi_major_axis**3 / MU) * np.arange(16)
    state = fly(time=revolutions, forces=Forces(j2=True)).target
    h = np.cross(state[:, :3], state[:, 3:])
    node = np.unwrap(np.arctan2(h[:, 0], -h[:, 1]))
    motion, p = np.sqrt(MU / LOW.semi_major_axis**3), LOW.semi_major_axis * (1 - 0.01**2)
    expected = -1.5 * J2 * (EARTH_RADIUS / p) ** 2 * motion * np.cos(LOW.inclination)
    found = np.polyfit(revolutions, node, 1)[0]
    assert found == pytest.approx(expected, rel=0.01)  # of the order of J2 · 1.5, and of the short periods that drift


def test_an_equal_force_on_both_bodies_leaves_a_path_of_nothing():
    path = fly(start=np.zeros(6), forces=Forces(j2=True)).path
    assert not path.any()


def test_a_burn_moves_the_chaser_as_in_free_space_for_a_short_time():
    acceleration = np.array([1e-3, 2e-3, -1e-3])
    time = np.array([0.0, 30.0, 60.0, 100.0])
    burn = Burn(20.0, 20.0, tuple(acceleration))
    shift = fly(HIGH, time=time, forces=Forces(burns=(burn,))).path - fly(HIGH, time=time).path
    moved = [0.0, 0.5 * 10**2, 0.5 * 20**2 + 20 * 20, 0.5 * 20**2 + 20 * 60]
    np.testing.assert_allclose(shift, -np.outer(moved, acceleration), atol=1e-3)  # (n t)² = 5e-5 of 3 m


def test_a_pulse_starts_another_kepler_orbit():
    time = np.linspace(0, 6000, 30)
    forces = Forces(bit=1e-3, pulse_times=(1000.0,))
    target, start = at_epoch(LOW), START
    after = time > 1000
    then = np.array([1000.0])
    chaser = propagated(target - start, MU, then)[0]
    path = fly(time=time, forces=forces).path
    kicks = [np.concatenate([np.zeros(3), sign * 1e-3 * axis]) for axis in np.eye(3) for sign in (1, -1)]
    expected = [
        (propagated(target, MU, time[after]) - propagated(chaser + kick, MU, time[after] - 1000))[:, :3]
        for kick in kicks
    ]
    off = [np.abs(path[after] - other).max() for other in expected]
    assert min(off) < 1e-4  # of 10 m, squared over the orbit's radius
    np.testing.assert_allclose(path[~after], by_kepler(LOW, START, time[~after])[:, :3], atol=ROUNDED)


def test_white_acceleration_scatters_the_end_as_the_root_of_a_third_of_the_cubed_time():
    time, white = np.array([0.0, 50.0, 100.0]), 1e-6
    free = fly(HIGH, time=time).path[-1]
    ends = [fly(HIGH, time=time, forces=Forces(white=white), seed=seed).path[-1] - free for seed in range(60)]
    spread = np.sqrt(np.mean(np.square(ends)))
    assert spread == pytest.approx(white * np.sqrt(100.0**3 / 3), rel=4 / np.sqrt(2 * 180))  # 4 sigma of 180 numbers


def test_the_target_is_carried_along_its_orbit_to_both_sides():
    for end in (-500.0, 900.0):
        expected = propagated(at_epoch(LOW), MU, np.array([end]))[0]
        np.testing.assert_allclose(carried(at_epoch(LOW), 0.0, end, Forces()), expected, rtol=1e-10, atol=1e-4)
