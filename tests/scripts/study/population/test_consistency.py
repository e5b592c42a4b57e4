"""NEES of positions, and of quantities in several units."""

import numpy as np
import pytest

from baryscope.study.population.consistency import WRONG, limit, nees


def test_nees_is_that_of_the_covariance():
    assert nees(np.array([1.0, 2.0, 0.0]), np.diag([1.0, 4.0, 9.0])) == pytest.approx(2)
    assert nees(np.zeros(3), np.diag([1.0, -1e-9, 1.0])) == np.inf
    assert nees(np.array([1.0, np.nan, 0.0]), np.eye(3)) == np.inf


def test_nees_does_not_depend_on_the_units():
    """A position in metres and a velocity in nm/s or Gm/s: their variances are up to 1e36 apart."""
    P = np.array([[2.0, 1.2], [1.2, 1.0]])
    expected = np.linalg.solve(P, [1.0, -0.5]) @ [1.0, -0.5]
    for unit in (1e-9, 1.0, 1e9):
        scale = np.array([1.0, unit])
        assert nees(scale * [1.0, -0.5], P * np.outer(scale, scale)) == pytest.approx(expected, rel=1e-12)


def test_limits_are_those_of_tables():
    """χ² at 0.999, of three and six degrees of freedom (Abramowitz and Stegun, table 26.8)."""
    assert pytest.approx(16.266, abs=5e-4) == WRONG
    assert limit(6) == pytest.approx(22.458, abs=5e-4)
