"""Passes of `ekf` that do not come to rest."""

import numpy as np
import pytest

from baryscope.estimator.ekf.passes import refuse_lost
from baryscope.estimator.ekf.problem import FAR
from baryscope.models.errors import ComputationError


@pytest.mark.parametrize("away", [1.1 * FAR, np.nan, np.inf])
def test_a_path_that_is_lost_is_refused(away):
    """Further than the standard deviation of its weak prior from features that are a metre away."""
    seen = np.ones((2, 4, 3))
    refuse_lost(0.9 * FAR * np.ones((2, 3)), seen)
    with pytest.raises(ComputationError, match="diverges"):
        refuse_lost(np.array([[1.0, 0.0, 0.0], [away, 0.0, 0.0]]), seen)
