"""Tracks of a tumbling body in the axes of a camera that turns, with errors of its rig; none of baryscope's models."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.attitude import AttitudeSeries
from baryscope.estimator.camera.camera import Camera
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.tracks import FeatureTracks
from free_paths import ORBIT
from synthetic import ENVISAT, attitude, box_features

POINTS = box_features(9, (10, 4, 3), 3, centre=(1.0, 0.5, -0.3))
ARM = np.array([1.0, -0.5, 0.3])
RATE = np.deg2rad([0.4, 2.8, 2.0])


@dataclass(frozen=True)
class Seen:
    """Tracks in camera axes, the camera as its files tell, and the true path (n, 3) in C."""

    tracks: FeatureTracks
    camera: Camera
    com: np.ndarray


def scalar_first(rotation):
    return np.roll(rotation.as_quat(), 1, axis=-1)


def turning_camera(time, com, rig, *, noise=0.0, seed=0, turn=None, errors=True):
    """Tracks of a body at com (n, 3), seen by a camera of attitude `turn`, with errors drawn from the rig's deviations.

    Without `turn` it is that of the LVLH axes, with slow swings of 6°.
    """
    rng = np.random.default_rng(seed)
    if turn is None:
        swing = 0.1 * np.column_stack([np.sin(time / 60), np.cos(time / 80), np.sin(time / 50)])
        turn = Rotation.from_matrix(ORBIT.R_I_L(time)) * Rotation.from_rotvec(swing)
    draw = rng.standard_normal if errors else np.zeros
    boresight = Rotation.from_rotvec(np.array(rig.boresight_deviation) * draw(3))
    told = turn * Rotation.from_rotvec(np.array(rig.attitude_noise) * draw((len(time), 3)))
    place = turn.apply(np.array(rig.lever_arm) + np.array(rig.lever_arm_deviation) * draw(3))
    points = com[:, None] + POINTS @ np.swapaxes(attitude(ENVISAT, RATE, time), 1, 2)
    seen = np.stack([one.inv().apply(own - c) for one, own, c in zip(turn * boresight, points, place, strict=True)])
    seen = seen * (1 + rig.scale_deviation * float(draw(1)[0])) + noise * rng.standard_normal(seen.shape)
    tracks = FeatureTracks(time, seen, [f"F{index}" for index in range(len(POINTS))])
    return Seen(tracks, Camera(AttitudeSeries(time, scalar_first(told)), rig), com)


def uncertain_rig():
    """The rig of the issue: 1e-4 rad, 1e-3 rad, 1e-4 and 1 cm."""
    return Rig(
        lever_arm=tuple(ARM),
        lever_arm_deviation=0.01,
        boresight_deviation=1e-3,
        scale_deviation=1e-4,
        attitude_noise=1e-4,
    )
