"""The truth of the second population, against conservation laws, and Kepler's orbits in extended precision."""

import numpy as np
import pytest

from baryscope.study.population.second.cases import drawn
from oracles import inertial_states, propagate_kepler

GTO, LATE = (1, 6), (1, 3)  # e = 0.65; the first time is far from 0


@pytest.fixture(scope="module")
def cases():
    return [drawn(1, index) for index in range(8)]


def test_tumbles_keep_their_energy_and_angular_momentum(cases):
    for case in cases:
        momentum_B = case.rate @ case.start.inertia
        energy = np.sum(case.rate * momentum_B, axis=1)
        momentum = np.einsum("nij,nj->ni", case.attitude, momentum_B)
        # 1e-12 of a step, over some thousand steps
        np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
        np.testing.assert_allclose(momentum - momentum[0], 0, atol=1e-10 * np.linalg.norm(momentum[0]))


def test_attitudes_turn_at_the_rate(cases):
    """Over a time that is short against a rotation, R(t + dt) is R(t) exp([ω dt]×), by the mean ω."""
    for case in cases:
        dt = np.diff(case.time)
        vector = (case.rate[1:] + case.rate[:-1]) / 2 * dt[:, None]
        angle = np.linalg.norm(vector, axis=1)
        change = np.swapaxes(case.attitude[:-1], 1, 2) @ case.attitude[1:]
        found = np.stack([change[:, k, i] - change[:, i, k] for i, k in ((1, 2), (2, 0), (0, 1))], axis=1) / 2
        off = np.linalg.norm(found - vector * np.sinc(angle / np.pi)[:, None], axis=1)
        assert (off[angle < 0.3] < angle[angle < 0.3] ** 2).all()


@pytest.mark.parametrize("key", [(1, 0), (1, 2), GTO, LATE])
def test_paths_are_the_difference_of_two_kepler_orbits(key):
    case = drawn(*key)
    start, mu = case.start, case.orbit.gravitational_parameter
    target = propagate_kepler(*inertial_states(case.orbit, np.zeros(3), np.zeros(3))[0], mu, start.time)
    chaser = target[0] + start.state[:3], target[1] + start.state[3:]
    some = np.linspace(0, len(case.time) - 1, 12).astype(int)
    for k in some:
        after = case.time[k] - start.time
        expected = propagate_kepler(*target, mu, after)[0] - propagate_kepler(*chaser, mu, after)[0]
        # 1e-12 of a step of up to 150 m, over some thousand steps
        np.testing.assert_allclose(case.path[k], expected.astype(float), atol=1e-7)


def test_the_special_cases_are_special():
    assert drawn(*GTO).start.orbit.e > 0.6
    assert abs(drawn(*LATE).start.time) > 100
