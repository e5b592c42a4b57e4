"""Linear motion against closed forms of free flight and of Clohessy and Wiltshire, and against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from baryscope.estimator.paths.linear_motion import ARC, Integrations, LinearMotion, Panels, forced
from baryscope.models.ephemeris.trajectory import gravity_gradient, lvlh_axes, target_states
from baryscope.models.relative_orbit import relative_transition
from synthetic import Orbit

ORBIT = Orbit(semi_major_axis=9.2e6, eccentricity=0.2).model()
LONGEST = ARC / ORBIT.periapsis_rate


def gradient(time):
    return gravity_gradient(ORBIT, target_states(ORBIT, time))


def no_gradient(time):
    return None


def in_inertial_axes(time):
    """The matrices (n, 6, 6) from (ρ, ρ̇) in LVLH to those in inertial axes."""
    states = target_states(ORBIT, time)
    R, turn = lvlh_axes(states), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    rate = np.linalg.norm(np.cross(states[:, :3], states[:, 3:]), axis=1) / np.sum(states[:, :3] ** 2, axis=1)
    found = np.zeros((len(time), 6, 6))
    found[:, :3, :3] = found[:, 3:, 3:] = R
    found[:, 3:, :3] = R @ (rate[:, None, None] * turn)
    return found


@pytest.mark.parametrize("epoch", [-100.0, 0.0, 2500.0, 8800.0])
def test_transition_is_that_of_yamanaka_and_ankersen(epoch):
    time = np.linspace(0, ORBIT.period, 101)
    equation = LinearMotion.over(Panels.over(time, epoch, LONGEST), gradient)
    start = np.linalg.inv(in_inertial_axes(np.array([epoch])))
    expected = in_inertial_axes(time) @ relative_transition(ORBIT, time, epoch) @ start
    scale = np.repeat([1.0, 1 / ORBIT.mean_motion], 3)
    found = equation.transition(time)
    np.testing.assert_allclose(found * scale[:, None] / scale, expected * scale[:, None] / scale, atol=1e-8)


@given(
    jumps=st.lists(st.floats(0.0, 100.0), max_size=6),
    epoch=st.floats(-20.0, 120.0),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=30)
def test_free_flight_with_accelerations_that_jump(jumps, epoch, seed):
    """∫∫ of a piecewise constant acceleration, interval by interval."""
    jumps, rng = np.sort(jumps), np.random.default_rng(seed)
    values = rng.normal(size=(len(jumps) + 1, 3, 2))
    time = rng.uniform(0, 100, 20)

    def acceleration(t):
        return values[np.searchsorted(jumps, t, "right")]

    motion = forced(time, epoch, no_gradient, acceleration, 7.0, jumps)
    for t, position, velocity in zip(time, motion.position(time), motion.velocity(time), strict=True):
        sign, low, high = np.sign(t - epoch), min(t, epoch), max(t, epoch)
        edges = np.clip(np.concatenate([[low], jumps, [high]]), low, high)
        first = np.diff(edges)
        # ∫ (t − s) a ds
        second = (t - edges[:-1]) ** 2 / 2 - (t - edges[1:]) ** 2 / 2
        np.testing.assert_allclose(velocity, sign * np.tensordot(first, values, 1), atol=1e-9)
        np.testing.assert_allclose(position, sign * np.tensordot(second, values, 1), atol=1e-7)


def test_forced_motion_on_an_orbit_is_that_of_scipy():
    epoch, time = 3000.0, np.linspace(10, 8990, 37)
    directions = np.random.default_rng(1).normal(size=(3, 2))

    def acceleration(t):
        return 1e-5 * np.stack([np.sin(t / 300), (t > 5000) - 0.5], axis=1)[:, None] * directions

    motion = forced(time, epoch, gradient, acceleration, min(LONGEST, 300.0), np.array([5000.0]))
    for column in range(2):
        for end, stop in ((0.0, None), (5000.0, None), (9000.0, 5000.0)):
            wanted = time[(time >= min(end, epoch)) & (time <= max(end, epoch))]

            def slope(t, s, column=column):
                return np.concatenate(
                    [s[3:], gradient(np.array([t]))[0] @ s[:3] + acceleration(np.array([t]))[0, :, column]]
                )

            parts, state, begin = [epoch, *([] if stop is None else [stop]), end], np.zeros(6), epoch
            for part in parts[1:]:
                inside = np.sort(wanted[(wanted - begin) * (wanted - part) <= 0])
                inside = inside if part > begin else inside[::-1]
                solution = solve_ivp(slope, (begin, part), state, "DOP853", [*inside, part], rtol=1e-11, atol=1e-11)
                np.testing.assert_allclose(motion.position(inside)[:, :, column], solution.y[:3, :-1].T, atol=2e-7)
                np.testing.assert_allclose(motion.velocity(inside)[:, :, column], solution.y[3:, :-1].T, atol=2e-9)
                state, begin = solution.y[:, -1], part


def test_times_in_any_order_and_at_the_epoch():
    motion = forced(np.array([9.0, 2.0]), 5.0, no_gradient, lambda t: np.ones((len(t), 3, 1)), 100.0)
    np.testing.assert_allclose(motion.position(np.array([9.0, 5.0, 2.0]))[:, 0, 0], [8, 0, 4.5], rtol=1e-12)
    alone = Panels.over(np.array([5.0]), 5.0, 10.0)
    np.testing.assert_allclose(LinearMotion.over(alone, no_gradient).transition(np.array([5.0])), [np.eye(6)])


def test_what_reaches_as_far_is_integrated_once():
    """Of times beyond begin … end the last reaches are kept, and of those within always one."""
    asked = []

    def integrate(reach):
        asked.append(tuple(reach))
        return reach

    integrations = Integrations(integrate, 0.0, 10.0)
    for time in ([1.0, 9.0], [12.0, 5.0], [4.0], [12.0], [-3.0], [12.0, 3.0], [], [14.0], [15.0], [-3.0], [2.0]):
        reach = integrations.over(np.array(time))
        assert reach[0] <= min(time, default=0.0)
        assert max(time, default=10.0) <= reach[1]
    assert asked == [(0.0, 10.0), (0.0, 12.0), (-3.0, 10.0), (0.0, 14.0), (0.0, 15.0), (-3.0, 10.0)]
