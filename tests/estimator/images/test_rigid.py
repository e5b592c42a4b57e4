"""Features that don't move with the body."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.images.rigid import BodyMap


def test_a_feature_that_slides_is_named_and_others_are_not():
    rng, body = np.random.default_rng(1), BodyMap()
    points, sigma = rng.uniform(-0.4, 0.4, (20, 3)), np.array([1e-4, 1e-4, 3e-3])
    covariance = np.tile(np.diag(sigma**2), (20, 1, 1))
    given_up, wrongly = 0, 0
    for frame in range(30):
        R = Rotation.from_rotvec([0.0, 0.05 * frame, 0.02 * frame]).as_matrix()
        slid = points.copy()
        slid[7, 1] += 1e-3 * frame  # ten standard deviations a frame
        seen = slid @ R.T + [0.1, 0.0, 5.0] + sigma * rng.normal(size=(20, 3))
        stray = body.strays(list(range(20)), seen, covariance)
        given_up += int(stray[7])
        wrongly += int(np.delete(stray, 7).sum())
    assert given_up > 20
    # Beyond five deviations of three numbers are 1.5e-5 of 570 sightings, but the gate is of the deviation of a frame.
    assert wrongly <= 1
