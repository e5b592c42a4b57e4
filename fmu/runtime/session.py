"""Steps a unit of FMI 2 or 3 from Python, with buffers that are allocated once."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.layout.archive import UnitFile, open_unit
from baryscope.fmu.runtime.arguments import array_of, number_of
from baryscope.fmu.runtime.instance import Buffer, Instance, UnitError
from baryscope.fmu.runtime.state import SavedState, read_times
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.variables import Kind, Variable

__all__ = ["Session", "UnitError"]

FloatArray = NDArray[np.float64]
SMALLEST_TOLERANCE = 1e-15  # as for the parameter solver.tolerance


class Session:
    """One instance of the unit, for use in a `with` block.

        with Session("target.fmu", {"target.angularRate0": [0.0, 0.06, 0.01]}) as session:
            session.step(0.1, torque=[0.0, 0.0, 5.0])
            print(session.time, session.features)

    Inputs keep their values until they are set again. Outputs are read once per step; properties and `session[name]`
    return copies.

    Attributes:
        time: the time reached, s.
        outputs: all outputs, flat, in the order of the table of variables; read-only, overwritten by each step.
    """

    def __init__(
        self,
        fmu: AnyPath,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ):
        """Load the unit and initialise it.

        Args:
            fmu: an FMU made by `baryscope build` or `build_fmu`, of FMI 2 or 3.
            parameters: values by name, arrays in the shapes of the table of variables; others keep their starts.
            start_time: time at the start, s.
            stop_time: time past which the unit refuses to step, s.
            tolerance: tightens the parameter solver.tolerance, never loosens it.

        Raises:
            InputError: the file is no unit of ours for this machine, or a parameter's name or shape is unknown.
            UnitError: the unit refuses a parameter; the message says why.
        """
        self._unit = open_unit(Path(fmu))
        self._instance: Instance | None = None
        self._states: WeakSet[SavedState] = WeakSet()
        try:
            self._instance = Instance(self._unit)
            self._inputs = _Block(self._unit.of_kind(Kind.INPUT), self._unit)
            self._outputs = _Block(self._unit.of_kind(Kind.OUTPUT), self._unit)
            self.outputs = self._outputs.values.view()
            self.outputs.flags.writeable = False
            self.reset(parameters, start_time=start_time, stop_time=stop_time, tolerance=tolerance)
        except BaseException:
            self.close()
            raise

    @property
    def instance(self) -> Instance:
        """The instance of the unit.

        Raises:
            InputError: the session was closed.
        """
        if self._instance is None:
            raise InputError("the session was closed")
        return self._instance

    def reset(
        self,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ) -> None:
        """Start again with these parameters, all others at their start values and the inputs at zero.

        Raises:
            InputError, UnitError: as for the constructor.
        """
        start = number_of("start_time", start_time)
        stop = None if stop_time is None else number_of("stop_time", stop_time)
        bound = None if tolerance is None else number_of("tolerance", tolerance)
        if bound is not None and not bound >= SMALLEST_TOLERANCE:
            raise InputError(f"tolerance: found {bound:g}, expected a value of at least {SMALLEST_TOLERANCE:g}")
        instance = self.instance
        instance.reset()
        for name, value in (parameters or {}).items():
            self._set_parameter(self._unit.find(name, Kind.PARAMETER), value)
        instance.initialise(start, stop, bound)
        self._inputs.values[:] = 0.0
        self.time, self._time_rest = start, 0.0
        instance.get(self._outputs)

    def tune(self, parameters: Mapping[str, ArrayLike]) -> None:
        """Change tunable parameters during a run, one after the other, and read the outputs again.

        Raises:
            InputError: a name or a shape is unknown, or the parameter is fixed.
            UnitError: the unit refuses a value, and keeps the former.
        """
        changes = [(self._unit.find(name, Kind.PARAMETER), value) for name, value in parameters.items()]
        for variable, _ in changes:
            if not variable.tunable:
                names = ", ".join(v.name for v in self._unit.variables if v.tunable)
                raise InputError(f"{variable.name}: is fixed after the start, expected one of {names}")
        try:
            for variable, value in changes:
                self._set_parameter(variable, value)
        finally:
            self.instance.get(self._outputs)

    def _set_parameter(self, variable: Variable, value: ArrayLike) -> None:
        array = array_of(variable.name, value, variable.shape)
        references = self._unit.references(variable)
        if variable.boolean:
            if np.isnan(array):
                raise InputError(f"{variable.name}: found nan, expected true or false")
            self.instance.set_boolean(references[0], bool(array.item() != 0))
        else:
            buffer = Buffer(references, variable.size, self._unit.fmi)
            buffer.values[:] = array.ravel()
            self.instance.set(buffer)

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
            UnitError: the duration is not above zero, an input is not finite, or the integration fails; the
                session is as it was before the call.
        """
        if acceleration is not None or torque is not None:
            self.set_inputs(acceleration=acceleration, torque=torque)
        instance = self.instance
        instance.step(self.time, duration)
        self._advance_time(duration)
        instance.get(self._outputs)

    def _advance_time(self, duration: float) -> None:
        """Add to the time by Kahan's sum, so that 60,000 steps of 0.1 s end at 6,000 s."""
        increment = duration + self._time_rest
        time = self.time + increment
        self._time_rest = increment - (time - self.time)
        self.time = time

    def step_to(self, time: float) -> None:
        """Advance to `time`, s, without accumulating rounding of the time."""
        self.step(time - self.time)
        self.time, self._time_rest = time, 0.0

    def state(self) -> SavedState:
        """The whole state of the session; a restored run continues bitwise equally."""
        state = SavedState(self.instance, self.time, self._time_rest)
        self._states.add(state)
        return state

    def restore(self, state: SavedState | bytes) -> None:
        """Restore a state, including time, inputs and parameters.

        Args:
            state: from `state`, of this session or another of the same unit, or its bytes.

        Raises:
            InputError: the state was closed, or the bytes are not those of a saved state.
            UnitError: the state is of another unit; the session is as it was before.
        """
        instance = self.instance
        if isinstance(state, SavedState):
            instance.restore(state.pointer)
            self.time, self._time_rest = state.time, state.time_rest
        else:
            time, rest, content = read_times(state)
            pointer = instance.deserialise(content)
            try:
                instance.restore(pointer)
            finally:
                instance.free_state(pointer)
            self.time, self._time_rest = time, rest
        instance.get(self._inputs)
        instance.get(self._outputs)

    def __getitem__(self, name: str) -> FloatArray:
        """A copy of an output by its name in the table of variables, in its shape."""
        return self._outputs[self._unit.find(name, Kind.OUTPUT).name].copy()

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The unit's table of variables."""
        return self._unit.variables

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

    def close(self) -> None:
        """Free the instance and the unpacked files; closing twice is fine."""
        for state in list(self._states):
            state.close()
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.close()
        shutil.rmtree(self._unit.folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


_ACCELERATION, _TORQUE = "chaser.acceleration", "target.torque"


class _Block(Buffer):
    """The variables of one kind in one buffer, with a view of each by its name."""

    def __init__(self, variables: Sequence[Variable], unit: UnitFile):
        references = [reference for variable in variables for reference in unit.references(variable)]
        super().__init__(references, sum(variable.size for variable in variables), unit.fmi)
        self._views: dict[str, FloatArray] = {}
        start = 0
        for variable in variables:
            part = self.values[start : start + variable.size]
            self._views[variable.name] = part.reshape(variable.shape)
            start += variable.size

    def __getitem__(self, name: str) -> FloatArray:
        return self._views[name]

    def __setitem__(self, name: str, value: ArrayLike) -> None:
        view = self._views[name]
        view[...] = array_of(name, value, view.shape)
