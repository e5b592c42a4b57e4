"""Inertias that a body can have."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.dynamics.inertia import of_a_body
from synthetic import ENVISAT

J = ENVISAT / np.trace(ENVISAT)


def test_an_inertia_no_body_has_becomes_that_of_a_thin_one():
    """Principal moments 0.002, 0.118 and 0.88 break the triangle inequality; Envisat's obey it."""
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    found = of_a_body(turn @ np.diag([0.002, 0.118, 0.88]) @ turn.T)
    moments = np.linalg.eigvalsh(found)
    assert moments.sum() == pytest.approx(1)
    assert moments[2] < moments[0] + moments[1]
    assert np.abs(found @ turn - turn @ np.diag(moments)).max() < 1e-12
    np.testing.assert_allclose(of_a_body(7 * ENVISAT), J, atol=1e-12)
