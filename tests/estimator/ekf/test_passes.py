"""When passes of `ekf` come to rest, and when they do not."""

import numpy as np
import pytest

from baryscope.estimator.ekf.passes import refuse_lost, squared_length
from baryscope.estimator.ekf.problem import FAR
from baryscope.models.errors import ComputationError


@pytest.mark.parametrize("away", [1.1 * FAR, np.nan, np.inf])
def test_a_path_that_is_lost_is_refused(away):
    """Further than the standard deviation of its weak prior from features that are a metre away."""
    seen = np.ones((2, 4, 3))
    refuse_lost(0.9 * FAR * np.ones((2, 3)), seen)
    with pytest.raises(ComputationError, match="diverges"):
        refuse_lost(np.array([[1.0, 0.0, 0.0], [away, 0.0, 0.0]]), seen)


def test_a_step_is_measured_by_a_covariance_that_rounding_has_made_singular():
    """Of inertia that is told to sixteen digits along an axis, as without noise: it was an internal error."""
    regular = np.array([[2.0, 0.5], [0.5, 1.0]])
    step = np.array([0.3, -0.2])
    assert squared_length(step, regular) == pytest.approx(step @ np.linalg.inv(regular) @ step, rel=1e-12)
    singular = np.ones((2, 2))  # nothing moves against its null space but by rounding
    assert squared_length(np.array([0.3, 0.3]), singular) == pytest.approx(0.09, rel=1e-9)
    assert squared_length(np.array([0.3, -0.3]), singular) > 1e13
    assert squared_length(np.zeros(2), np.zeros((2, 2))) == 0
