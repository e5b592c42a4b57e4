"""Steps TumblingTarget of FMI 2 or 3 from Python, with buffers that are allocated once."""

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.layout.archive import Tables
from baryscope.fmu.runtime.base import BaseSession
from baryscope.fmu.runtime.instance import UnitError
from baryscope.fmu.units.target import TARGET
from baryscope.models.errors import InputError

__all__ = ["Session", "UnitError"]

FloatArray = NDArray[np.float64]


class Session(BaseSession):
    """One instance of TumblingTarget, for use in a `with` block.

        with Session("target.fmu", {"target.angularRate0": [0.0, 0.06, 0.01]}) as session:
            session.step(0.1, torque=[0.0, 0.0, 5.0])
            print(session.time, session.features)

    Inputs keep their values until they are set again. Outputs are read once per step; properties and `session[name]`
    return copies.

    Attributes:
        time: the time reached, s.
        outputs: all outputs, flat, in the order of the table of variables; read-only, overwritten by each step.
    """

    tables: ClassVar[Tables] = {TARGET.name: TARGET.table}

    def set_inputs(self, *, acceleration: ArrayLike | None = None, torque: ArrayLike | None = None) -> None:
        """Set inputs for the following steps.

        Args:
            acceleration: commanded acceleration of the chaser, (3,), m/s², LVLH.
            torque: torque on the target, (3,), N m, body axes.
        """
        block, instance = self._inputs, self.instance
        try:
            if acceleration is not None:
                block[_ACCELERATION] = acceleration
            if torque is not None:
                block[_TORQUE] = torque
            instance.set(block)
        except (InputError, UnitError):
            instance.get(block)
            raise

    def step(self, duration: float, *, acceleration: ArrayLike | None = None, torque: ArrayLike | None = None) -> None:
        """Advance by `duration` seconds with the inputs held, then read all outputs.

        Raises:
            UnitError: the duration is not above zero, an input is not finite, or the integration fails. Time, state and
                outputs are as they were before the call; inputs too, unless they were set and only the step failed.
        """
        if acceleration is not None or torque is not None:
            self.set_inputs(acceleration=acceleration, torque=torque)
        instance = self.instance
        instance.step(self.time, duration)
        self._advance_time(duration)
        instance.get(self._outputs)

    def step_to(self, time: float) -> None:
        """Advance to `time`, s, without accumulating rounding of the time."""
        end = float(time)
        self.step(end - self.time)
        self.time, self._time_rest = end, 0.0

    @property
    def features(self) -> FloatArray:
        """Positions of the features, (n, 3), m, frame C."""
        return self["features"]

    @property
    def normals(self) -> FloatArray:
        """Outward normals at the features, (n, 3), frame C."""
        return self["normals"]

    @property
    def position(self) -> FloatArray:
        """The target's CoM, (3,), m, frame C."""
        return self["target.position"]

    @property
    def attitude(self) -> FloatArray:
        """Attitude of the target, quaternion (w, x, y, z), body to inertial."""
        return self["target.attitude"]

    @property
    def chaser_position(self) -> FloatArray:
        """The chaser from the target's CoM, (3,), m, LVLH."""
        return self["chaser.position"]

    @property
    def chaser_velocity(self) -> FloatArray:
        """The chaser's velocity in LVLH, (3,), m/s."""
        return self["chaser.velocity"]


_ACCELERATION, _TORQUE = "chaser.acceleration", "target.torque"
