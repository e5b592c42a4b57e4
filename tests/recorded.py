"""Tracks that tests of files write and read again."""

import numpy as np

from baryscope.estimator import FeatureTracks
from synthetic import ENVISAT, attitude, box_features, make_case

TIME = np.arange(0.0, 20.0, 0.5)
LABELS = ("left", "right", "ÿ top", "back")


def box_tracks():
    """Four features in 40 frames, some not seen, one frame without any."""
    points = box_features(4, (2, 2, 2), seed=3)
    case = make_case(TIME, attitude(ENVISAT, np.deg2rad((9.0, 3.0, 6.0)), TIME), np.zeros((40, 3)), points, noise=0.001)
    position = case.tracks.position + np.array([1.0, -2.0, 5.0])
    position[5:9, 2] = position[20] = np.nan
    return FeatureTracks(TIME, position, LABELS)


def same(found, tracks, rtol=1e-12):
    assert found.labels == tracks.labels
    np.testing.assert_allclose(found.time, tracks.time, atol=1e-9)
    np.testing.assert_allclose(found.position, tracks.position, rtol=rtol)
    if tracks.covariance is not None:
        np.testing.assert_allclose(found.covariance, tracks.covariance, rtol=rtol)
