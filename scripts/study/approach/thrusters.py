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
    camera's axes at the middle of a step, to where these and LVLH, which commands turn with, go on as they did in the
    two steps before.

    orbit: the target's; scale: what accelerations are too large by, as a part of them; misalignment: (3,), the rotation
    vector in the camera's axes by which they point elsewhere, rad.
    """

    def __init__(self, orbit: Orbit, scale: float = 0.0, misalignment: FloatArray | None = None) -> None:
        self._orbit, self._scale = orbit, scale
        self._turn = np.zeros(3) if misalignment is None else misalignment
        self._last = self._turned = Rotation.identity()
        self._steps = 0

    def __call__(self, units: Mapping[str, Unit], time: float) -> None:
        """From a communication point on, s: another acceleration of the chaser than the command."""
        target, controller = units["target"], units["controller"]
        R_L_V = self._seen_from_orbit(Rotation.from_quat(controller.vector("camera.attitude"), scalar_first=True), time)
        axes = self._halfway(R_L_V)
        pushed = (axes * Rotation.from_rotvec(self._turn) * axes.inv()).apply(controller.vector("command.acceleration"))
        target.set(target.scalars("chaser.acceleration"), (1.0 + self._scale) * pushed)

    def _seen_from_orbit(self, R_I_V: Rotation, time: float) -> Rotation:
        return Rotation.from_matrix(lvlh_attitude(self._orbit, np.array([time]))[0]).inv() * R_I_V

    def _halfway(self, R_L_V: Rotation) -> Rotation:
        """The axes half a step later, by the parabola through the rotation vectors of the last three."""
        turned = R_L_V * self._last.inv() if self._steps > 0 else Rotation.identity()
        before = self._turned if self._steps > 1 else turned
        half = 0.5 * turned.as_rotvec() + 0.375 * (turned.as_rotvec() - before.as_rotvec())
        self._last, self._turned, self._steps = R_L_V, turned, self._steps + 1
        return Rotation.from_rotvec(half) * R_L_V
