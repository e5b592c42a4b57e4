"""What the adjustment's results are looked at by."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.diagnostics import information_in_body


def test_information_in_axes_of_the_body_is_the_inverse_of_the_covariance_there():
    """Of ellipsoids that are not along the axes of the body, with what they have beside the diagonal."""
    rng = np.random.default_rng(1)
    turn = Rotation.random(5, random_state=2).as_matrix()
    roots = rng.normal(size=(5, 4, 3, 3)) * [1.0, 1.0, 9.0]
    covariance = roots @ np.swapaxes(roots, 2, 3)
    shown = rng.random((5, 4)) < 0.7
    covariance[~shown] = np.nan
    found = information_in_body(shown, covariance, turn)
    for frame, feature in np.ndindex(5, 4):
        R = turn[frame]
        expected = np.linalg.inv(R.T @ covariance[frame, feature] @ R) if shown[frame, feature] else np.zeros((3, 3))
        np.testing.assert_allclose(found[frame, feature], expected, rtol=1e-9, atol=1e-9)
