"""The online estimator with a stereo rig's points, whose depths are far less precise than their directions."""

import numpy as np
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator
from tops import errors, straight, tracks

DRAWS, ALPHA = 12, 1e-4  # of the chi-square band
FOCAL_LENGTH, BASELINE, PIXEL = 1900.0, 0.2, 0.05  # px, m, px: 0.5 mm across and 7 cm along the line of sight
AXES = [0, 2, 1]  # the cameras look along y


def triangulated(rng, true):
    """Points (n, m, 3) of a rectified pair, from u and v in the left image and u in the right, and covariances."""
    x, y, z = np.moveaxis(true[..., AXES], 2, 0)
    pixels = np.stack([x, y, x - BASELINE]) / z * FOCAL_LENGTH + PIXEL * rng.standard_normal((3, *z.shape))
    u, v, disparity = pixels[0], pixels[1], pixels[0] - pixels[2]
    scale, none = BASELINE / disparity, np.zeros_like(u)
    x, y, z = u * scale, v * scale, FOCAL_LENGTH * scale
    by_left = np.stack([scale - x / disparity, -y / disparity, -z / disparity], axis=2)
    by_row, by_right = np.stack([none, scale, none], axis=2), np.stack([x, y, z], axis=2) / disparity[..., None]
    J = np.stack([by_left, by_row, by_right], axis=3)[:, :, AXES]
    return np.stack([x, y, z], axis=2)[..., AXES], PIXEL**2 * J @ np.swapaxes(J, 2, 3)


def test_a_map_of_the_wrong_size_is_seen_too_far_away_in_all_frames_alike():
    """What is known of the shape tells the depth of a frame far better than its own depths do, but for one factor.

    The bank took that for new in every frame, and was sure of a motion that was none: at 150 s the mean NEES of these
    draws was 8.
    """
    time = np.arange(150.0)
    path = straight(time)
    nees = []
    for draw in range(DRAWS):
        rng, filter = np.random.default_rng([61, draw]), OnlineEstimator(1.0)
        seen = zip(time, *triangulated(rng, tracks(rng, time, path, sigma=0.0)), strict=True)
        states = [filter.update(float(t), points, covariance=covariances) for t, points, covariances in seen]
        nees.append(errors(states, path)[1][[89, 149]])
    assert (np.sum(nees, axis=0) < chi2.ppf(1 - ALPHA, 3 * DRAWS)).all()
