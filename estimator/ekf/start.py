"""The initial state of `ekf` from a registration of the first frames, with its standard deviations."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.geometry.so3 import log_rotation
from baryscope.estimator.registration.clusters import find_bodies
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

MAX_FRAMES = 100  # with three features or more, for the noise and the first poses
MIN_FRAMES = 4  # for a rate and the noise
MAX_RATE_FRAMES = 20  # for the rate
MAX_RATE_ANGLE = 0.5  # rad that the target turns in these frames
INFLATION = 3.0  # factor on the standard deviations, as the filter uses these frames again


@dataclass(frozen=True, eq=False)
class Start:
    """The initial state.

    frame: the first with an attitude; centroid (3,) of the features there, in C, m; radius of the features, m; rate
    (3,) in B, rad/s, and its standard deviation; speed: standard deviation of the velocity of the centre of mass, m/s;
    noise: standard deviation of a coordinate from the registration, m. The axes B are parallel to C in this frame.
    """

    frame: int
    centroid: FloatArray
    radius: float
    rate: FloatArray
    rate_deviation: float
    speed: float
    noise: float


def start_from(tracks: FeatureTracks, inliers: BoolArray) -> Start:
    """The initial state from the first frames in which the inliers (n, m) determine an attitude.

    Raises:
        ComputationError: the first frames determine no attitude, or no rate.
    """
    posed = np.nonzero(inliers.sum(axis=1) >= 3)[0]
    window = slice(int(posed[0]), int(posed[:MAX_FRAMES][-1]) + 1) if len(posed) else slice(0, None)
    registered = find_bodies(tracks.position[window], inliers[window])
    main = max(range(len(registered.bodies)), key=lambda index: len(registered.bodies[index].frames))
    body, origin, noise = registered.bodies[main], registered.origins[main], registered.noise
    frames = window.start + body.frames
    time = tracks.time[frames] - tracks.time[frames[0]]
    turn = log_rotation(body.attitude[0].T @ body.attitude)
    if len(frames) < MIN_FRAMES:
        raise ComputationError(
            f"the first attitudes are seen in {counted(len(frames), 'frame')}, {MIN_FRAMES} are needed for a rate",
            Reason.TOO_FEW_FRAMES,
        )
    turned_enough = np.linalg.norm(turn, axis=1) > MAX_RATE_ANGLE
    count = min(max(int(np.argmax(turned_enough)) if turned_enough.any() else len(turned_enough), 2), MAX_RATE_FRAMES)
    time, turn = time[:count], turn[:count]
    # B is parallel to C in the first frame, so rotation vectors from there have the same components in C and in B.
    turn_B = turn @ body.attitude[0].T
    rate = (time @ turn_B) / (time @ time)
    points = body.points
    radius = float(np.sqrt(np.mean(np.sum(points**2, axis=1))))
    speed = float(np.linalg.norm(rate))
    by_noise = INFLATION * noise / radius * np.sqrt(3 / len(points)) * np.sqrt(2 / (time @ time))
    by_change = speed**2 * time[-1] / 2  # for an angular acceleration of at most ω²
    drift = float(np.linalg.norm(origin[count - 1] - origin[0])) / time[-1]
    return Start(
        int(frames[0]),
        origin[0],
        radius,
        rate,
        float(np.hypot(by_noise, by_change)),
        INFLATION * (drift + speed * radius),
        noise,
    )
