"""Thrusters that are wrong, which nobody tells the estimator or the controller: by a scale, pointing elsewhere, or each
push by an error of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from baryscope.fmu.system.master import Unit
from baryscope.models.lvlh import lvlh_attitude
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExecutionErrors:
    """Errors of each push (Gates 1963, JPL TR 32-504): of its size, as a part of it, and of its direction about each
    axis, rad; normal deviates.
    """

    size: float
    direction: float
    random: np.random.Generator

    def drawn(self) -> tuple[float, Rotation]:
        """The scale and the rotation of the next push."""
        scale, *turn = self.random.standard_normal(4)
        return 1.0 + self.size * scale, Rotation.from_rotvec(self.direction * np.array(turn))


class WrongThrusters:
    """Pushes the chaser otherwise than commanded; a `Pilot` of `fly_loop`.

    The thrusters are fixed to the chaser as its camera is, which turns to look at the target: they are wrong in the
    camera's axes at the middle of a step, to where these and LVLH, which commands turn with, go on as they did in the
    two steps before.

    orbit: the target's; scale: what accelerations are too large by, as a part of them; misalignment: (3,), the rotation
    vector in the camera's axes by which they point elsewhere, rad; execution: errors of each push beside these, which
    lasts for a step.
    """

    def __init__(
        self,
        orbit: Orbit,
        scale: float = 0.0,
        misalignment: FloatArray | None = None,
        execution: ExecutionErrors | None = None,
    ) -> None:
        self._orbit, self._scale, self._execution = orbit, scale, execution
        self._turn = np.zeros(3) if misalignment is None else misalignment
        self._last = self._turned = Rotation.identity()
        self._steps = 0

    def __call__(self, units: Mapping[str, Unit], time: float) -> None:
        """From a communication point on, s: another acceleration of the chaser than the command."""
        target, controller = units["target"], units["controller"]
        R_L_V = self._seen_from_orbit(Rotation.from_quat(controller.vector("camera.attitude"), scalar_first=True), time)
        axes = self._halfway(R_L_V)
        turn, scale = Rotation.from_rotvec(self._turn), 1.0 + self._scale
        if self._execution is not None:
            own, turned = self._execution.drawn()
            turn, scale = turned * turn, own * scale
        pushed = (axes * turn * axes.inv()).apply(controller.vector("command.acceleration"))
        target.set(target.scalars("chaser.acceleration"), scale * pushed)

    def _seen_from_orbit(self, R_I_V: Rotation, time: float) -> Rotation:
        return Rotation.from_matrix(lvlh_attitude(self._orbit, np.array([time]))[0]).inv() * R_I_V

    def _halfway(self, R_L_V: Rotation) -> Rotation:
        """The axes half a step later, by the parabola through the rotation vectors of the last three."""
        turned = R_L_V * self._last.inv() if self._steps > 0 else Rotation.identity()
        before = self._turned if self._steps > 1 else turned
        half = 0.5 * turned.as_rotvec() + 0.375 * (turned.as_rotvec() - before.as_rotvec())
        self._last, self._turned, self._steps = R_L_V, turned, self._steps + 1
        return Rotation.from_rotvec(half) * R_L_V
