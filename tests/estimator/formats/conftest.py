"""Tracks that are written and read, with and without covariances."""

import numpy as np
import pytest

from baryscope.estimator import FeatureTracks
from recorded import LABELS, TIME, box_tracks


@pytest.fixture(scope="module")
def tracks():
    return box_tracks()


@pytest.fixture(scope="module")
def precise(tracks):
    """The same with a covariance for each observation."""
    root = np.random.default_rng(2).normal(size=(40, 4, 3, 3))
    covariance = 1e-6 * root @ np.swapaxes(root, 2, 3)
    covariance[~tracks.seen] = np.nan
    return FeatureTracks(TIME, tracks.position, LABELS, covariance, "2026-03-01T12:00:00")
