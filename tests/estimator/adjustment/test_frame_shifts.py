"""Shifts of whole frames beside errors of features that last: the variance of a mean, in closed form."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.frame_shifts import FrameShifts

FEATURES, NOISE, SLIP, LASTING = 7, 0.02, 0.005, 12.0  # m, both deviations; frames


def test_a_mean_of_features_is_as_uncertain_as_features_and_frames_are():
    """In n frames with errors of the features that last for L of them it has the variance (L σ²/m + s²)/n, of which L
    σ²/n is that of an observation of weight 1 in all frames; in a single frame σ²/m + s².
    """
    attitude = Rotation.random(3, random_state=np.random.default_rng(0)).as_matrix()
    found = FrameShifts.of(None, np.ones((3, 3)), SLIP**2, NOISE**2, LASTING)
    for unit, covariance in ((NOISE**2, found.in_body(attitude)), (LASTING * NOISE**2, found.among_all(attitude))):
        expected = np.tile((unit / FEATURES + SLIP**2) * np.eye(3), (3, 1, 1))
        np.testing.assert_allclose(unit * (np.eye(3) / FEATURES + covariance), expected, atol=1e-15)


@pytest.mark.parametrize(("slip", "variance"), [(0.0, NOISE**2), (SLIP**2, np.nan)])
def test_there_are_none_without_noise_or_without_a_variance(slip, variance):
    assert FrameShifts.of(None, np.ones((3, 3)), slip, variance, 1.0) is None
