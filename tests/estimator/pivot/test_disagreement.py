"""Clusters that put common features in other places of the body than each other, by the tumble's attitudes, too."""

import numpy as np
import pytest

from baryscope.estimator import PathOptions, Status, estimate
from baryscope.estimator.findings import DisagreeingClusters
from baryscope.estimator.tracks import FeatureTracks
from synthetic import ENVISAT, attitude, box_features, make_case

TIME = np.arange(240.0)
CENTRE = np.array([3.0, -5.0, 20.0])
NOISE = 0.002
COMMON = [3, 4]


def tracked(shift, seed):
    """Features 0 to 4 are seen in the first half, 3 to 7 in the second, where the common ones are shifted in B, m."""
    points, halves = box_features(8, (4, 3, 2), 1), [(0.0, 119.0, range(5)), (120.0, 239.0, range(3, 8))]
    parts = []
    for begin, end, features in halves:
        moved = points + (begin > 0) * np.isin(np.arange(8), COMMON)[:, None] * shift * np.array([1.0, 0.5, -1.0])
        turning = attitude(ENVISAT, np.deg2rad([1.0, 1.0, 3.0]), TIME)
        clusters = [(begin, end, list(features))]
        parts.append(
            make_case(TIME, turning, np.tile(CENTRE, (240, 1)), moved, noise=NOISE, clusters=clusters, seed=seed)
        )
    position = np.where(TIME[:, None, None] < 120, parts[0].tracks.position, parts[1].tracks.position)
    return FeatureTracks(TIME, position, parts[0].tracks.labels)


@pytest.mark.parametrize("method", ["pivot", "ml", "ekf"])
@pytest.mark.parametrize(("shift", "disagree"), [(0.0, False), (0.003, True)])
def test_features_that_have_moved_between_two_clusters_are_named(method, shift, disagree):
    for seed in range(2):
        found = estimate(tracked(shift, seed), method=method, options=PathOptions(trajectory="fixed"))
        named = [one for one in found.findings if isinstance(one, DisagreeingClusters)]
        assert bool(named) == disagree
        assert found.status is (Status.MODEL_DOES_NOT_FIT if disagree else Status.GOOD)
