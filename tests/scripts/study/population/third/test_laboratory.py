"""A led rotation against finite differences, and a pivot's walk against its statistics."""

import numpy as np
import pytest

from baryscope.study.population.third.laboratory import body_rates, led, pivot, turns
from baryscope.study.population.third.timing import Timing

INERTIA = np.diag([0.4, 0.35, 0.25])


def vectors_of(change):
    return np.stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]], axis=1)


def test_the_rate_of_a_rotation_vector():
    rng = np.random.default_rng(1)
    phi, change, step = rng.normal(0, 1, (20, 3)), rng.normal(0, 1, (20, 3)), 1e-6
    turned = np.swapaxes(turns(phi), 1, 2) @ (turns(phi + step * change) - turns(phi - step * change)) / (2 * step)
    np.testing.assert_allclose(body_rates(phi, change), vectors_of(turned), atol=1e-8)  # step², and ε over it


@pytest.mark.parametrize("limited", [True, False])
def test_a_hand_turns_a_body_at_the_rate_that_is_said(limited):
    timing = Timing(np.arange(0, 10, 1e-3), 0.5, ())
    found, _ = led(np.random.default_rng(2), INERTIA, timing, limited)
    R = found.attitude
    change = np.swapaxes(R[1:-1], 1, 2) @ (R[2:] - R[:-2]) / 2e-3
    np.testing.assert_allclose(vectors_of(change), found.rate[1:-1], atol=1e-5)  # step² of rates of 1 rad/s


@pytest.mark.parametrize("seed", range(5))
def test_a_limited_joint_stays_within_its_cone(seed):
    timing = Timing(np.linspace(0, 100, 500), 0.5, ())
    found, words = led(np.random.default_rng(seed), INERTIA, timing, True)
    cone = float(words[0].split()[-1][:-1])
    assert 20 <= cone <= 60
    relative = np.einsum("nji,mjk->nmik", found.attitude[::10], found.attitude[::10])
    angle = np.degrees(np.arccos(np.clip((np.trace(relative, axis1=2, axis2=3) - 1) / 2, -1, 1)))
    assert angle.max() <= 2 * (cone + 0.5)  # the words are rounded
    assert angle.max() > 10


def test_a_pivot_stays_unless_it_slips():
    time = np.linspace(0, 60, 100)
    found = pivot(np.random.default_rng(1), time, 2.0, False)
    np.testing.assert_allclose(np.linalg.norm(found.path, axis=1), 2.0)
    assert found.words == ()
    assert not np.ptp(found.path, axis=0).any()


def test_a_slipping_pivot_walks_at_random():
    time = np.linspace(0, 60, 100)
    ends = []
    for seed in range(200):
        found = pivot(np.random.default_rng(seed), time, 2.0, True)
        size = 1e-3 * float(found.words[0].split()[2])
        ends.append((found.path[-1] - found.path[0]) / size)
    # 600 numbers of unit variance: 4 sigma, and the words are rounded to 2 digits.
    assert np.std(ends) == pytest.approx(1.0, abs=4 / np.sqrt(1200) + 0.03)
