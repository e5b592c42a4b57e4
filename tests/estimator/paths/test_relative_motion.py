"""Relative motion under J2 against two integrated orbits, without it against the closed form."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.paths.relative_motion import MOST_WEIGHTS, PerturbedOrbit, RelativeOrbit
from baryscope.models.errors import ComputationError
from baryscope.models.orbit import EARTH_J2, EARTH_RADIUS
from oracles import fallen
from synthetic import Orbit

START = (np.array([-4.0, -18.0, 3.0]), np.array([0.004, -0.007, 0.01]))  # of the chaser in LVLH, m and m/s


def orbit(eccentricity, oblate):
    flown = Orbit(semi_major_axis=7.2e6 / (1 - eccentricity), eccentricity=eccentricity).model()
    return replace(flown, j2=EARTH_J2, equatorial_radius=EARTH_RADIUS) if oblate else flown


@pytest.mark.parametrize("eccentricity", [0.001, 0.2, 0.7])
def test_without_perturbations_it_is_the_closed_form(eccentricity):
    flown, epoch = orbit(eccentricity, False), 2000.0
    time = np.random.default_rng(1).uniform(-0.2, 1.1, 40) * flown.period
    x = np.concatenate([START[0], START[1] / flown.mean_motion])
    found, expected = PerturbedOrbit(flown, epoch), RelativeOrbit(flown, epoch)
    np.testing.assert_allclose(found.at(time).position(x), expected.at(time).position(x), atol=1e-7)
    np.testing.assert_allclose(found.at(time).jacobian, expected.at(time).jacobian, atol=1e-7)
    np.testing.assert_allclose(found.rate_at(time).position(x), expected.rate_at(time).position(x), atol=1e-10)
    np.testing.assert_allclose(found.rate_at(time).jacobian, expected.rate_at(time).jacobian, atol=1e-10)


def test_a_spline_is_the_same_as_a_matrix_and_for_each_values():
    """Of some of the times between the same nodes the matrix is small; to the rounding of sums of twenty metres."""
    flown = orbit(0.2, False)
    time = np.linspace(0.0, 0.2 * flown.period, 4001)
    x = np.concatenate([START[0], START[1] / flown.mean_motion])
    path = RelativeOrbit(flown, 100.0)
    many, few = path.at(time), path.at(time[::5])
    nodes = len(path._nodes(time))
    assert len(time[::5]) * nodes <= MOST_WEIGHTS < len(time) * nodes
    assert len(path._nodes(time[::5])) == nodes
    np.testing.assert_allclose(few.position(x), many.position(x)[::5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(few.jacobian, many.jacobian[::5], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("eccentricity", [0.001, 0.2, 0.7])
def test_under_j2_it_is_the_difference_of_two_integrated_orbits(eccentricity):
    """What is left of errors of the steps, which are common, is their rounding, some 1e-7 m."""
    flown, epoch = orbit(eccentricity, True), 0.0
    time = np.linspace(0, flown.period, 41)
    true = fallen(flown, *START, time)
    x = np.concatenate([START[0], START[1] / flown.mean_motion])
    path = PerturbedOrbit(flown, epoch)
    found = path.at(time).position(x)
    np.testing.assert_allclose(found, true[:, :3], atol=2e-6)
    np.testing.assert_allclose(path.rate_at(time).position(x), true[:, 3:], atol=2e-9)
    without = RelativeOrbit(orbit(eccentricity, False), epoch).at(time).position(x)
    assert np.abs(found - without).max() > 1  # m, by J2
    moved = [path.at(time).position(h) - path.at(time).position(-h) for h in 0.5 * np.eye(6)]
    np.testing.assert_allclose(np.stack(moved, axis=2), path.at(time).jacobian, atol=1e-6)


def test_a_chaser_that_falls():
    flown = orbit(0.001, True)
    sampled = PerturbedOrbit(flown, 0.0).at(np.linspace(0, flown.period, 11))
    with pytest.raises(ComputationError, match="too far for its relative motion to be found"):
        sampled.position(np.array([-6e6, 0, 0, 0, 0, 0.0]))
