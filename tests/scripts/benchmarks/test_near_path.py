"""The chain of states against integrals over the noise, and against integrals of the motion."""

import numpy as np
import pytest
from scipy.integrate import quad

from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.paths.relative_motion import RelativeOrbit
from baryscope.models.scenario import load_scenario
from baryscope.scripts.benchmarks.near_path import disturbance, increment_root, transitions, with_noise

DENSITY, SPAN = 1e-6, 60.0  # m²/s³, s


@pytest.fixture(scope="module")
def orbit_path():
    return RelativeOrbit(load_scenario("envisat").orbit, SPAN / 2)


def test_an_increment_has_the_covariance_of_integrated_white_noise():
    step = 7.0
    root = increment_root(DENSITY, step)
    response = [lambda s: step - s, lambda s: step]  # of position and of velocity × step, to an impulse at s
    expected = [[quad(lambda s, a=a, b=b: DENSITY * a(s) * b(s), 0, step)[0] for a in response] for b in response]
    assert root @ root.T == pytest.approx(np.array(expected), rel=1e-12)


def test_transitions_carry_a_path_from_time_to_time(orbit_path):
    time, step = np.linspace(0.0, SPAN, 7), SPAN / 6
    x = np.array([1.0, -2.0, 0.5, 0.3, 0.1, -0.4])
    state = np.concatenate([orbit_path.at(time).jacobian, step * orbit_path.rate_at(time).jacobian], axis=1) @ x
    assert np.einsum("kij,kj->ki", transitions(orbit_path, time), state[:-1]) == pytest.approx(state[1:], abs=1e-9)


def test_a_path_of_the_model_has_no_increments_and_is_the_cubic_between_states(orbit_path):
    time = np.linspace(0.0, SPAN, 121)
    near = with_noise(orbit_path, np.zeros(6), time, DENSITY)
    knots, x = np.linspace(0.0, SPAN, near.blocks), np.array([1.0, -2.0, 0.5, 0.3, 0.1, -0.4])
    u = np.concatenate([orbit_path.at(knots).jacobian, knots[1] * orbit_path.rate_at(knots).jacobian], axis=1) @ x
    assert near.blocks == 7
    assert near.increments(u) == pytest.approx(np.zeros(36), abs=1e-6)  # in standard deviations
    assert near.position(u) == pytest.approx(orbit_path.at(time).jacobian @ x, abs=1e-9)


def test_a_disturbance_has_the_variance_of_twice_integrated_noise_in_free_flight():
    time, rng = np.linspace(0.0, SPAN, 5), np.random.default_rng(1)
    free = Polynomial(1, 0.0, SPAN)
    ends = np.array([disturbance(free, time, DENSITY, rng)[-1] for _ in range(1000)])
    expected = DENSITY * SPAN**3 / 3
    assert np.mean(ends**2) == pytest.approx(expected, rel=4 * np.sqrt(2 / 3000))  # four standard deviations
