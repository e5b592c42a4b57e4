"""A path on an orbit that it tells itself, against orbits with drawn elements, by vis-viva and Laplace's vector."""

import numpy as np

from baryscope.estimator.orbits.elements import LocalElements
from baryscope.estimator.orbits.estimated import on_estimated_orbit
from baryscope.models.ephemeris.trajectory import target_states
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
