"""What several tests of images share: a satellite at rest in C, tumbling, rendered here; and films."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.models.scenario import load_scenario
from baryscope.study.images.scene import Setting, watched

PRECESSION, SPIN = np.deg2rad([[1.0, 1.5, -1.0], [0.8, -0.5, 2.2]])  # rad/s, in C and in B


@cache
def scene(frames, width=400, seed=1, noise=2.0):
    """A pair a second; the centre of mass is 5 m away."""
    time = np.arange(float(frames))
    start = Rotation.from_rotvec([-1.6, 0.4, 2.4])
    turn = [Rotation.from_rotvec(rate * time[:, None]) for rate in (PRECESSION, SPIN)]
    attitude = (turn[0] * start * turn[1]).as_matrix()
    path = np.tile([3.0, -4.0, 0.5], (frames, 1))
    setting = Setting(duration=frames - 1.0, rate=1.0, width=width, noise=noise)
    orbit = load_scenario("cubesat-class").orbit
    return watched(setting, orbit, (time, path, attitude), np.random.SeedSequence(seed))


def video(path, rate, values):
    """Write a film of 64 × 48 px whose frames are each of one grey value."""
    import cv2

    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), rate, (64, 48))
    for value in values:
        writer.write(np.full((48, 64, 3), value, np.uint8))
    writer.release()
    return path
