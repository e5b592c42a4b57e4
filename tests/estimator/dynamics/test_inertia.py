"""Inertias that a body can have."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.dynamics.inertia import BEYOND, Excess, of_a_body
from baryscope.models.attitude import INERTIA_BASIS
from synthetic import ENVISAT, differences

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


def test_the_excess_is_that_of_the_greatest_moment_over_the_other_two():
    """A moment of 0.58 of the trace exceeds the sum of the others by 0.16 of it, twice the mass's negative moment."""
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    beyond = turn @ np.diag([0.1, 0.32, 0.58]) @ turn.T
    found = Excess.of(beyond)
    assert found.value == pytest.approx(0.08 / BEYOND)
    assert found.cost == pytest.approx(found.value**2)

    def value(change):
        return np.array([Excess.of(beyond + np.tensordot(change, INERTIA_BASIS, 1)).value])

    slope = differences(value, np.zeros(5))[0]
    np.testing.assert_allclose(found.slope, slope, atol=1e-7 / BEYOND)
    np.testing.assert_allclose(found.pull, found.value * slope, atol=1e-6 / BEYOND**2)
    np.testing.assert_allclose(found.information, np.outer(slope, slope), atol=1e-6 / BEYOND**2)
    none = Excess.of(J)
    assert none.cost == 0
    assert not none.pull.any()
    assert not none.information.any()
