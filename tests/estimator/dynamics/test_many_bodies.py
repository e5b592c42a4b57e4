"""Many bodies at once, against each by itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from baryscope.estimator.dynamics.many_bodies import motions
from baryscope.estimator.dynamics.rotation import Rotation
from synthetic import Orbit

INERTIA = np.diag([0.28, 0.33, 0.39])
RATE = np.array([0.02, 0.035, 0.03])  # rad/s


@pytest.mark.parametrize("orbit", [None, Orbit().model()])
@pytest.mark.parametrize("span", [0.0, 70.3, -600.0])
def test_motions_of_many_are_those_of_each(orbit, span):
    """Of bodies at rates from almost nothing to a tenth of a radian a second, in steps that are twice as long."""
    rates = np.random.default_rng(3).standard_normal((12, 3)) * np.geomspace(1e-6, 0.1, 12)[:, None]
    bodies = [Rotation(10.0, Turn.from_rotvec(20 * one).as_matrix(), one, INERTIA, orbit) for one in rates]
    time = 10.0 + span * np.array([0.4, 1.0, 0.0])
    for middle in (bodies[0], bodies[7], bodies[-1]):
        R, rate, followed = motions(bodies, middle, middle.at(time))
        assert followed.all()
        for one, attitudes, rates in zip(bodies, R, rate, strict=True):
            np.testing.assert_allclose(attitudes, one.at(time).attitude, atol=1e-5)
            np.testing.assert_allclose(rates, one.at(time).rate, atol=1e-6)


def test_neighbours_of_a_body_are_followed_nearly_as_exactly_as_it_is():
    """In long steps all were off alike, by a thousandth of a percent of the rate: more than tracks may leave open."""
    time = np.linspace(0.0, 700.0, 50)
    middle = Rotation(0.0, np.eye(3), RATE, INERTIA)
    rng = np.random.default_rng(4)
    bodies = [middle.changed(np.zeros(3), 1e-5 * rng.standard_normal(8)) for _ in range(6)]
    for one, R, rate in zip(bodies, *motions(bodies, middle, middle.at(time, 0.1))[:2], strict=True):
        exact = one.at(time, 0.1)
        # By 1e-3 of what long steps did: neighbours are off by a ten-thousandth of a radian.
        np.testing.assert_allclose(R, exact.attitude, atol=1e-8)
        np.testing.assert_allclose(rate, exact.rate, atol=1e-8 * np.linalg.norm(RATE))


def test_a_motion_that_cannot_be_followed_is_told():
    fast = Rotation(0.0, np.eye(3), 1e4 * RATE, INERTIA)
    slow = replace(fast, rate=RATE)
    R, _, followed = motions([slow, fast], slow, slow.at(np.array([900.0])))
    assert followed.tolist() == [True, False]
    assert np.isfinite(R[0]).all()
