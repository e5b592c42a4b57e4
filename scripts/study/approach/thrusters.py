"""Thrusters that are wrong, which nobody tells the estimator or the controller: by a scale, or pointing elsewhere."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.fmu.system.master import Unit
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]


class WrongThrusters:
    """Pushes the chaser otherwise than commanded; a `Pilot` of `fly_loop`.

    The thrusters are fixed to the chaser as its camera is, which turns to look at the target: they are wrong in the
    camera's axes at the middle of a step, to where these turn on.

    orbit: the target's; scale: what accelerations are too large by, as a part of them; misalignment: (3,), the rotation
    vector in the camera's axes by which they point elsewhere, rad.
    """

    def __init__(self, orbit: Orbit, scale: float = 0.0, misalignment: FloatArray | None = None) -> None:
        self._orbit, self._scale = orbit, scale
        self._turn = np.zeros(3) if misalignment is None else misalignment
        self._before: Rotation | None = None

    def __call__(self, units: Mapping[str, Unit], time: float) -> None:
        """From a communication point on, s: another acceleration of the chaser than the command."""
        target, controller = units["target"], units["controller"]
        R_I_V = Rotation.from_quat(controller.vector("camera.attitude"), scalar_first=True)
        half = np.zeros(3) if self._before is None else 0.5 * (R_I_V * self._before.inv()).as_rotvec()
        self._before = R_I_V
        R_I_L = Rotation.from_matrix(lvlh_attitude(self._orbit, np.array([time]))[0])
        axes = R_I_L.inv() * Rotation.from_rotvec(half) * R_I_V
        pushed = (axes * Rotation.from_rotvec(self._turn) * axes.inv()).apply(controller.vector("command.acceleration"))
        target.set(target.scalars("chaser.acceleration"), (1.0 + self._scale) * pushed)
