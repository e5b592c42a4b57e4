"""Where `ekf` starts from: what the first few frames show by registration, and how little that is."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.geometry.so3 import log_rotation
from baryscope.estimator.registration.clusters import find_bodies
from baryscope.estimator.tracks import BoolArray, FeatureTracks, FloatArray
from baryscope.models.errors import ComputationError, Reason
from baryscope.models.words import counted

FRAMES = 100  # with three features or more, that noise and first poses are taken from, at most
LEAST = 4  # frames that a first rate and the noise need
RATE_FRAMES = 20  # that the rate is taken from, at most
SWEEP = 0.5  # rad that the target turns in them, at most
WIDER = 3.0  # times the deviations that the first frames give: the filter will see these frames again


@dataclass(frozen=True, eq=False)
class Start:
    """The first posed frame, the features' centroid (3,) there, in C, and their radius, m; the target's rate (3,) in B,
    rad/s, and its deviation; speed, m/s, that the centre of mass may have; noise of a coordinate, m, from registration.

    B are the axes that are parallel to C in this frame: its attitude is known by definition.
    """

    frame: int
    centroid: FloatArray
    radius: float
    rate: FloatArray
    rate_deviation: float
    speed: float
    noise: float


def start_from(tracks: FeatureTracks, inliers: BoolArray) -> Start:
    """The start from the first frames in which observations, inliers (n, m), show an attitude.

    Raises:
        ComputationError: the first frames show no attitude, or not how fast it changes.
    """
    enough = np.nonzero(inliers.sum(axis=1) >= 3)[0]
    window = slice(int(enough[0]), int(enough[:FRAMES][-1]) + 1) if len(enough) else slice(0, None)
    registered = find_bodies(tracks.position[window], inliers[window])
    main = max(range(len(registered.bodies)), key=lambda index: len(registered.bodies[index].frames))
    body, origin, noise = registered.bodies[main], registered.origins[main], registered.noise
    frames = window.start + body.frames
    time = tracks.time[frames] - tracks.time[frames[0]]
    turn = log_rotation(body.attitude[0].T @ body.attitude)
    if len(frames) < LEAST:
        raise ComputationError(
            f"the first attitudes are seen in {counted(len(frames), 'frame')}, {LEAST} are needed for a rate",
            Reason.TOO_FEW_FRAMES,
        )
    wide = np.linalg.norm(turn, axis=1) > SWEEP
    count = min(max(int(np.argmax(wide)) if wide.any() else len(wide), 2), RATE_FRAMES)
    time, turn = time[:count], turn[:count]
    # B is parallel to C in the first frame, so that turns from there are the same in C, and in B.
    turn_B = turn @ body.attitude[0].T
    rate = (time @ turn_B) / (time @ time)
    points = body.points
    radius = float(np.sqrt(np.mean(np.sum(points**2, axis=1))))
    pace = float(np.linalg.norm(rate))
    by_noise = WIDER * noise / radius * np.sqrt(3 / len(points)) * np.sqrt(2 / (time @ time))
    by_change = pace**2 * time[-1] / 2  # an angular acceleration of ω² at most
    drift = float(np.linalg.norm(origin[count - 1] - origin[0])) / time[-1]
    return Start(
        int(frames[0]),
        origin[0],
        radius,
        rate,
        float(np.hypot(by_noise, by_change)),
        WIDER * (drift + pace * radius),
        noise,
    )
