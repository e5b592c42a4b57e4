"""Steps any unit of ours from Python, by the names of its variables."""

from collections.abc import Mapping
from typing import ClassVar

from numpy.typing import ArrayLike

from baryscope.fmu.layout.archive import Tables
from baryscope.fmu.runtime.base import BaseSession
from baryscope.fmu.runtime.instance import UnitError
from baryscope.fmu.units import UNITS
from baryscope.models.errors import InputError
from baryscope.models.variables import Kind


class UnitSession(BaseSession):
    """One instance of any unit of ours, for use in a `with` block.

        with UnitSession("rig.fmu", {"dropout": 0.1}) as rig:
            rig.step(1.0, {"features": features, "normals": normals, "camera.attitude": attitude})
            print(rig["points"][rig["seen"]])

    Inputs keep their values until they are set again. `session[name]` returns a copy of an output.

    Attributes:
        time: the time reached, s.
    """

    tables: ClassVar[Tables] = {kind.name: kind.table for kind in UNITS.values()}

    def set_inputs(self, inputs: Mapping[str, ArrayLike]) -> None:
        """Set inputs for the following steps, by name, in the shapes of the table of variables.

        Raises:
            InputError: a name or a shape is unknown.
            UnitError: the unit refuses a value. Then none is set, as after an InputError.
        """
        block, instance = self._inputs, self.instance
        try:
            for name, value in inputs.items():
                block[self._unit.find(name, Kind.INPUT).name] = value
            instance.set(block)
            if block.flags is not None:
                instance.set_booleans(block.flags)
        except (InputError, UnitError):
            self._read(block)
            raise

    def step(self, duration: float, inputs: Mapping[str, ArrayLike] | None = None) -> None:
        """Advance by `duration` seconds with the inputs held, then read all outputs.

        Raises:
            InputError, UnitError: as for `set_inputs`; or the unit refuses the step. Time, state and outputs are then
                as they were; the inputs are set.
        """
        if inputs is not None:
            self.set_inputs(inputs)
        self.instance.step(self.time, duration)
        self._advance_time(duration)
        self._read(self._outputs)
