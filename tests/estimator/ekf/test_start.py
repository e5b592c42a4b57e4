"""The start of the filter: what the attitudes of a stereo rig tell."""

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.ekf.start import starts
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.method import solve_pivot
from synthetic import ENVISAT, attitude, box_features, rig_tracks

RATE = np.deg2rad([3.38, 0.45, 0.77])


def rates(R, time):
    """The rate (n, 3) between neighbours, rad/s, by central differences of the true attitudes."""
    turned = Rotation.from_matrix(np.swapaxes(R[:-2], 1, 2) @ R[2:]).as_rotvec() / (time[2:] - time[:-2])[:, None]
    return np.concatenate([turned[:1], turned, turned[-1:]])


def test_a_free_tumble_explains_the_attitudes_of_a_stereo_rig():
    """With errors of depth 28 times the lateral ones, attitudes of an unweighted registration are too noisy."""
    time = np.arange(0.0, 120.0, 2.0)
    R = attitude(ENVISAT, RATE, time)
    com = np.tile([4.0, -19.0, 3.0], (len(time), 1))
    tracks = rig_tracks(time, R, com, box_features(8, (10, 5, 5), seed=3, centre=(1, 0.5, 0)), seed=3)
    solved = solve_pivot(tracks, None, PathOptions(trajectory="fixed", process_noise="none"))
    start = next(starts(tracks, observations_of(tracks, tracks.seen), solved, (None,)))
    assert start.explained
    expected = np.interp(start.nodes.time, time, np.linalg.norm(rates(R, time), axis=1))
    np.testing.assert_allclose(np.linalg.norm(start.rate, axis=1), expected, rtol=5e-3)
    assert (start.weight > 0.5).mean() > 0.99
