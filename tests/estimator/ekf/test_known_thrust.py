"""The iterated extended Kalman filter where the chaser's thrust is told."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.thrust import KnownAcceleration
from synthetic import ENVISAT, Orbit, attitude, box_features, make_case


@pytest.mark.parametrize("on_orbit", [False, True])
def test_a_known_thrust_moves_the_path(on_orbit):
    """2 mm/s² for 40 of 200 s, in free flight or on an orbit so high that it is one: 0.2 m off without it."""
    time, thrust = np.arange(0.0, 200.0, 2.0), np.array([2e-3, 0.0, -1e-3])
    burning = np.clip(time - 60, 0, 40)
    moved = np.outer(burning**2 / 2 + 40 * np.clip(time - 100, 0, None), -thrust)
    com = np.array([4.0, -19.0, 3.0]) + moved
    case = make_case(
        time,
        attitude(ENVISAT, np.deg2rad((3.38, 0.45, 0.77)), time),
        com,
        box_features(6, (10, 5, 5), seed=3, centre=(1, 0.5, 0)),
        noise=0.02,
        seed=5,
    )
    orbit = Orbit(semi_major_axis=1e10).model() if on_orbit else None
    known = KnownAcceleration([0.0, 60.0, 100.0], np.outer([0, 1, 0], thrust))
    told = PathOptions(
        trajectory=None if on_orbit else "polynomial:1", process_noise="none", torque="none", acceleration=known
    )
    found, blind = (
        estimate(case.tracks, method="ekf", orbit=orbit, options=one)
        for one in (told, replace(told, acceleration=None))
    )
    for k in (0, 50, 99):
        error = found.position[k] - com[k]
        assert error @ np.linalg.solve(found.covariance[k], error) < 4.5**2
    assert np.linalg.norm(blind.position[50] - com[50]) > 10 * np.linalg.norm(found.position[50] - com[50])
    ahead = found.predict([220.0])
    error = ahead.position[0] - (com[-1] - 40 * thrust * 22)
    assert error @ np.linalg.solve(ahead.covariance[0, :3, :3], error) < 4.5**2
