"""A path on an orbit that it tells itself, against orbits with drawn elements, by vis-viva and Laplace's vector."""

import numpy as np
import pytest

from baryscope.estimator.orbits.elements import LocalElements
from baryscope.estimator.orbits.estimated import on_estimated_orbit
from baryscope.estimator.paths.nonlinear_path import curvature_away
from baryscope.models.ephemeris.trajectory import target_states
from baryscope.models.errors import ComputationError
from baryscope.models.relative_orbit import paths_from_chaser
from synthetic import MU, Orbit

SPAN = 3000.0  # s
ORBIT = Orbit(semi_major_axis=9e6, eccentricity=0.2, anomaly=1.0).model()
DRAWS = 2000


def period_and_eccentricity(state):
    r, v = state[:3], state[3:]
    a = 1 / (2 / np.linalg.norm(r) - v @ v / MU)
    return 2 * np.pi * np.sqrt(a**3 / MU), np.linalg.norm(np.cross(v, np.cross(r, v)) / MU - r / np.linalg.norm(r))


def part():
    state = target_states(ORBIT, np.array([SPAN / 2]))[0]
    elements = LocalElements.through(state[:3], state[3:], MU)
    return on_estimated_orbit(elements, np.array([5.0, -20.0, 3.0, 0.0, -10.0, 2.0]), 0.0, SPAN)


def test_deviations_of_period_and_eccentricity_are_those_of_drawn_orbits():
    """To 8 %, five deviations of what DRAWS tell of a deviation: √(1/(2 DRAWS)) of it."""
    found, rng = part(), np.random.default_rng(4)
    root = rng.standard_normal((6, 6)) * np.array([1, 1, 1, 2e-4, 1e-4, 3e-4])[:, None]  # of the elements
    unit = np.array([factor.value for factor in found.factors(np.ones(12), np.eye(12))])  # of an unknown
    of_x = np.zeros((12, 12))
    of_x[6:, 6:] = (root / unit[:, None]) @ (root / unit[:, None]).T
    drawn = rng.multivariate_normal(np.zeros(12), of_x, DRAWS)
    values = np.array(
        [
            period_and_eccentricity(target_states(found.moved(x).orbit(SPAN / 2, MU), np.array([SPAN / 2]))[0])
            for x in drawn
        ]
    )
    finding = found.finding(np.zeros(12), of_x)
    period, eccentricity = values.std(axis=0)
    np.testing.assert_allclose(finding.period_deviation, period, rtol=0.08)
    np.testing.assert_allclose(finding.eccentricity_deviation, eccentricity, rtol=0.08)
    np.testing.assert_allclose(
        [finding.period, finding.eccentricity], period_and_eccentricity(target_states(ORBIT, np.zeros(1))[0])
    )


def known_at_the_end(found, size):
    """Mean and covariance of the state at the end of the span and of the elements, `size` rad or parts uncertain."""
    x = np.concatenate([[5.0, -20.0, 3.0, 0.0, -10.0, 2.0], np.zeros(6)])
    place, rate = found.at(np.array([SPAN])), found.rate_at(np.array([SPAN]))
    unit = np.array([factor.value for factor in found.factors(np.ones(12), np.eye(12))])  # of an unknown
    mean = np.concatenate([place.position(x)[0], rate.position(x)[0], np.zeros(6)])
    return mean, np.diag(np.concatenate([[1e-4] * 3, [1e-10] * 3, (size / unit) ** 2]))


def test_what_is_ahead_on_an_uncertain_orbit_has_the_moments_of_drawn_orbits():
    """Half a revolution ahead, where the orbit is turned by 0.1 rad: of position and velocity, scaled by what
    drawn orbits have, each followed by itself. Means are to five deviations of what 64 pairs and DRAWS tell, variances
    to a factor of two, where squares of 64 normal deviates are the least claim: it is a fifth of that without.
    """
    found, time = part(), np.array([SPAN + 1500.0, SPAN + 4000.0])
    mean, covariance = known_at_the_end(found, np.array([0.1, 0.1, 0.1, 0.02, 0.02, 0.02]))
    curved = curvature_away(found, SPAN, (mean, covariance), time)
    drawn = np.random.default_rng(1).multivariate_normal(mean, covariance, DRAWS)
    x = np.zeros((DRAWS, 12))
    x[:, 6:] = drawn[:, 6:]
    elements = [found.moved(one).orbit(SPAN / 2, MU).elements for one in x]
    truth = paths_from_chaser(elements, SPAN, drawn[:, :6], time)
    linear = truth - found.beside_linear(SPAN, mean[:6], time)(drawn[:, :6], drawn[:, 6:])
    claimed = np.array([np.cov(linear[:, k].T) for k in range(2)])
    whole = np.array([np.cov(truth[:, k].T) for k in range(2)])
    by_known = np.array([np.linalg.lstsq(drawn - mean, one - one.mean(axis=0))[0].T for one in linear.swapaxes(0, 1)])
    by_known += curved.slope
    told = by_known @ covariance @ np.swapaxes(by_known, 1, 2) + curved.covariance
    for k in range(2):
        values, axes = np.linalg.eigh(whole[k])
        size = np.sqrt(values)
        off = axes.T @ (linear[:, k].mean(axis=0) + curved.mean[k] - truth[:, k].mean(axis=0)) / size
        np.testing.assert_allclose(off, 0.0, atol=5 * np.sqrt(1 / DRAWS + 1 / 64))
        ratio = np.linalg.eigvalsh(axes.T @ told[k] @ axes / np.outer(size, size))
        assert ratio[0] > 0.5
        assert ratio[-1] < 2.0
        flat = np.linalg.eigvalsh(axes.T @ claimed[k] @ axes / np.outer(size, size))
        assert flat[0] < 0.2


def test_at_the_end_of_the_tracks_nothing_is_added():
    found = part()
    mean, covariance = known_at_the_end(found, np.full(6, 0.05))
    curved = curvature_away(found, SPAN, (mean, covariance), np.array([SPAN]))
    for values in (curved.mean, curved.slope @ np.sqrt(covariance), curved.covariance):
        np.testing.assert_allclose(values, 0.0, atol=1e-9)


def test_members_of_no_ellipse_go_as_far_as_one():
    """An orbit of which nearly nothing is known: members would have eccentricities above one. But not without one."""
    found, time = part(), np.array([SPAN + 500.0])
    mean, covariance = known_at_the_end(found, np.array([0.1, 0.1, 0.1, 0.1, 0.5, 0.5]))
    assert np.isfinite(curvature_away(found, SPAN, (mean, covariance), time).covariance).all()
    mean[10] = 2 * np.sqrt(covariance[10, 10])
    with pytest.raises(ComputationError, match="no orbit"):
        curvature_away(found, SPAN, (mean, covariance), time)
