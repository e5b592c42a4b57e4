"""Axes along a direction: what makes them axes, for any direction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baryscope.models.sensor.directions import axes_along

CORNERS = [[1.0, 0, 0], [0, -1.0, 0], [0, 0, 1e-20], [1, 1, 1], [-1, 1, 0], [0, 1e-300, 1]]


@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 1e-6), length=st.floats(0.01, 100)
)
def test_right_handed_axes(direction, length):
    given = length * np.array(direction)
    R = axes_along(given[None])[0]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1)
    np.testing.assert_allclose(R[:, 2], given / np.linalg.norm(given), atol=1e-14)
    assert R[np.argmin(np.abs(given)), 0] == 0


@pytest.mark.parametrize("direction", CORNERS)
def test_directions_that_other_rules_fear(direction):
    R = axes_along(np.array([direction], dtype=float))[0]
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
