"""A camera's constant errors in predictions, against how what such a camera sees moves on."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.consider import considered
from baryscope.estimator.prediction import Prediction
from results import an_estimate
from turning_camera import turning_camera

STEP, SIGMA = 0.02, 1e-3  # s; rad or m, of each error
TIME = STEP * np.delete(np.arange(201), slice(81, 120))  # with a gap
PLACE = np.array([3.0, -20.0, 4.0])
TURNING = np.array([0.02, -0.03, 0.05])  # rad/s, the camera


class AtRest:
    """Predictions of a target at rest, known exactly."""

    def at(self, time, point):
        return Prediction.of(time, np.tile([*PLACE, 0.0, 0.0, 0.0], (len(time), 1)), np.zeros((len(time), 6, 6)))


def moved(kind, time):
    """What each error of one deviation moves the target by at times (n,), (n, 3, 3), for a camera in the origin."""
    axes = Rotation.from_rotvec(time[:, None] * TURNING).as_matrix().swapaxes(1, 2)
    return SIGMA * np.swapaxes(axes if kind == "lever_arm_deviation" else np.cross(axes, PLACE), 1, 2)


@pytest.mark.parametrize("kind", ["boresight_deviation", "lever_arm_deviation"])
def test_predictions_go_on_as_what_is_seen_moves_at_the_ends(kind):
    """In a frame, in the middle of a gap, over which the camera turns by 0.05 rad, and half a minute before and after.

    Rates are differences over two frames, at the ends those half a frame within: there it is turned by 6e-4 rad less,
    of 1.8 in that half minute.
    """
    turn = Rotation.from_rotvec(TIME[:, None] * TURNING)
    rest = np.tile(PLACE, (len(TIME), 1))
    seen = turning_camera(TIME, rest, Rig(**{kind: SIGMA}), turn=turn, errors=False)
    known = an_estimate(frames=len(TIME), time=TIME, position=rest, method="ekf", predictor=AtRest())
    found = considered(known, seen.camera.inertial(seen.tracks))
    nearest = np.array([0.0, 0.0, TIME[40], 100 * STEP, TIME[-1], TIME[-1]])
    away = np.array([-30.0, 0.0, 0.0, 0.0, 0.0, 30.0])
    rate = (moved(kind, nearest + 1e-4) - moved(kind, nearest - 1e-4)) / 2e-4
    columns = np.concatenate([moved(kind, nearest) + away[:, None, None] * rate, rate], axis=1)
    expected = columns @ np.swapaxes(columns, 1, 2)
    size = np.sqrt(np.einsum("ni,nj->nij", *2 * [np.einsum("nii->ni", expected)]))
    np.testing.assert_allclose(found.predict(nearest + away).covariance / size, expected / size, atol=2e-3)
