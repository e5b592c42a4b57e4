"""The online estimator with a stereo rig's points, whose depths are far less precise than their directions."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.online import OnlineEstimator
from tops import errors, straight, tracks, unread

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


def flat_and_far(rng, frames):
    """Times, points (n, 27, 3), covariances and path of a flat target 38 m away; depths to 0.2 m."""
    across, along = 0.0015, 0.2
    time = 3.7 * np.arange(frames)
    angles = np.linspace([0, 52, 0], [468, 52, 324], frames)
    turn = Rotation.from_euler("ZXZ", angles, degrees=True)
    flat = np.append(rng.uniform(-0.6, 0.6, (27, 2)), np.zeros((27, 1)), axis=1)
    features = Rotation.random(rng=rng).apply(flat) + np.array([0.6, 0.7, -0.4])
    path = np.array([3.0, 2.0, 38.0]) + np.outer(3e-4 * time, [1.0, -0.5, 0.3])
    points = path[:, None] + np.einsum("nij,mj->nmi", turn.as_matrix(), features)
    sight = points / np.linalg.norm(points, axis=2, keepdims=True)
    covariances = across**2 * np.eye(3) + (along**2 - across**2) * sight[..., :, None] * sight[..., None, :]
    noise = across * rng.standard_normal(points.shape) + along * rng.standard_normal((*points.shape[:2], 1)) * sight
    return time, points + noise, covariances, path


def test_a_flat_target_whose_depths_are_bad_is_not_known_before_it_has_turned():
    """At first its tilt is wrong by 7°, and so is its shape, in which lies what is seen of the offset.

    A filter that is linear about such a map found both to a fraction of their errors: the mean NEES of these was 56.
    """
    nees = []
    for draw in range(5):
        time, points, covariances, path = flat_and_far(np.random.default_rng([62, draw]), 900)
        filter = OnlineEstimator(1.0)
        seen = zip(time, points, covariances, strict=True)
        states = [filter.update(float(t), here, covariance=each) for t, here, each in seen]
        nees.append(errors(states[-1:], path[-1:])[1][0])
    assert sum(nees) < chi2.ppf(1 - ALPHA, 3 * len(nees))


def seen_badly(rng, frames):
    """Points (n, 5, 3) of a small target that turns about one axis and another, with their covariances, and its path.

    It has a radius of 1 m, is 38 m away, and its depths are known to 0.6 m: attitudes are off by half a radian.
    """
    time, body = 0.5 * np.arange(frames), rng.normal(size=(5, 3))
    body /= np.sqrt(np.mean(np.sum(body**2, axis=1)))
    angles = np.stack([0.06 * time, np.full(frames, 0.7), 0.036 * time], axis=1)
    R = (Rotation.random(rng=rng) * Rotation.from_euler("ZXZ", angles)).as_matrix()
    path = [0.0, 38.0, 0.0] + time[:, None] * [1e-3, 2e-3, -1e-3]
    true = path[:, None] + body @ np.swapaxes(R, 1, 2)
    sight = true[..., None] / np.linalg.norm(true, axis=2)[..., None, None]
    along = sight @ np.swapaxes(sight, 2, 3)
    root = 0.013 * (np.eye(3) - along) + 0.6 * along
    return time, true + np.einsum("nmij,nmj->nmi", root, rng.standard_normal(true.shape)), root @ root, path


def test_a_map_by_which_nothing_is_told_gives_way_to_the_mean_of_many_frames():
    """Of a first frame with such depths no later attitude was known well enough to tell anything, and four of these
    draws never got further: claims grew by the unknown velocity, to kilometres.
    """
    nees = []
    for draw in range(5):
        time, points, covariances, path = seen_badly(np.random.default_rng([64, draw]), 800)
        filter = OnlineEstimator(0.02)
        with unread(filter):
            for t, frame, spread in zip(time[:-1], points[:-1], covariances[:-1], strict=True):
                filter.update(float(t), frame, covariance=spread)
        state = filter.update(float(time[-1]), points[-1], covariance=covariances[-1])
        error, P = state.position - path[-1], state.covariance[:3, :3]
        assert np.sqrt(np.trace(P)) < 1.0
        nees.append(error @ np.linalg.solve(P, error))
    assert sum(nees) < chi2.ppf(1 - ALPHA, 3 * len(nees))
