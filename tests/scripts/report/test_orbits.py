"""LVLH axes in the scene of tracks without an orbit: those of the orbit that the tracks tell."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.models.lvlh import lvlh_attitude
from baryscope.report.orbits import UP_TO_A_TURN, found_orbit
from baryscope.report.own_tracks import scene_of_estimate
from free_paths import FEATURES, NOISE, ORBIT, in_orbit, turning
from synthetic import make_case

HALF_A_TURN = np.diag([-1.0, -1.0, 1.0])  # about the orbit's normal


@cache
def tracks():
    """About a revolution of a target that turns at a tenth of Envisat's rate."""
    time, R = turning(300, 1.1 * ORBIT.period / 300, 0.1)
    return make_case(time, R, in_orbit(time), FEATURES, noise=NOISE).tracks


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
def test_the_scene_has_the_axes_of_the_orbit_that_was_found(method):
    """It had inertial axes alone, though period and eccentricity were told."""
    result = estimate(tracks(), method=method)
    scene = scene_of_estimate(result, tracks(), None)
    R = Rotation.from_quat(np.reshape(scene.orbit, (-1, 4)), scalar_first=True).as_matrix()
    true = ORBIT.R_I_L(scene.time)
    apart = min(
        Rotation.from_matrix(np.swapaxes(true, 1, 2) @ R @ turn).magnitude().max() for turn in (np.eye(3), HALF_A_TURN)
    )
    assert apart < np.deg2rad(0.1)
    assert UP_TO_A_TURN in scene.about
    found = found_orbit(result)
    (finding,) = (one for one in result.findings if type(one).__name__ == "EstimatedOrbit")
    # That is told at the likeliest process noise, the path at the mean over what this may be.
    assert found.eccentricity == pytest.approx(finding.eccentricity, abs=0.3 * finding.eccentricity_deviation)
    np.testing.assert_allclose(lvlh_attitude(found, scene.time), R, atol=1e-9)


@pytest.mark.parametrize("method, trajectory", [("pivot", "polynomial"), ("score", None)])
def test_without_such_an_orbit_there_are_none(method, trajectory):
    given = {} if trajectory is None else {"options": PathOptions(trajectory=trajectory)}
    scene = scene_of_estimate(estimate(tracks(), method=method, **given), tracks(), None)
    assert scene.orbit is None
    assert UP_TO_A_TURN not in scene.about
