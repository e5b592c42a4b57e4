"""Stepping the unit from Python: `Session` step by step, `simulate` for whole runs.

Both call fmpy's low-level FMI functions with buffers allocated once.
"""

import ctypes
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2Boolean,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2Real,
    fmi2ValueReference,
)
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.archive import UnitFile, open_unit
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.variables import Kind, Variable

FloatArray = NDArray[np.float64]


class UnitError(ComputationError):
    """The unit refused a call or could not carry it out; the message is the unit's own."""


class Session:
    """One instance of the unit, to be stepped and read; use it in a `with` block.

        with Session("target.fmu", {"target.angularRate0": [0.0, 0.06, 0.01]}) as session:
            session.step(0.1, torque=[0.0, 0.0, 5.0])
            print(session.time, session.features)

    Inputs stay as they are until they are given again. Outputs are read once a step; what properties and
    `session[name]` return are copies, which later steps leave alone.

    Attributes:
        time: the time reached, s.
        outputs: all outputs, flat, in the order of the table of variables; read-only, overwritten by each step.
    """

    def __init__(
        self,
        fmu: str | Path,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ):
        """Load the unit and initialise it.

        Args:
            fmu: an FMU made by `baryscope build` or `build_fmu`.
            parameters: values by name, arrays in the shapes of the table of variables; others keep their starts.
            start_time: time at the start, s.
            stop_time: time past which the unit refuses to step, s.
            tolerance: tightens the parameter solver.tolerance, never loosens it.

        Raises:
            InputError: the file is no unit of ours for this machine, or a parameter's name or shape is unknown.
            UnitError: the unit refuses a parameter; the message says why.
        """
        self._messages: list[str] = []
        self._unit = open_unit(Path(fmu))
        self._slave: Any = None
        try:
            self._load()
            self._allocate()
            self.reset(parameters, start_time=start_time, stop_time=stop_time, tolerance=tolerance)
        except BaseException:
            self.close()
            raise

    def _load(self) -> None:
        unit = self._unit
        try:
            self._slave = FMU2Slave(
                guid=unit.guid,
                modelIdentifier=unit.model_identifier,
                unzipDirectory=str(unit.folder),
                instanceName="baryscope",
            )
        except Exception as error:  # fmpy raises bare Exceptions
            raise InputError(f"{unit.path}: cannot be loaded ({error}), expected a unit for this machine") from error
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self._guarded(lambda: self._slave.instantiate(callbacks=self._callbacks, loggingOn=True))

    def _allocate(self) -> None:
        """Buffers and their pointers, once for the whole session."""
        inputs, outputs = self._unit.of_kind(Kind.INPUT), self._unit.of_kind(Kind.OUTPUT)
        self._inputs = _Block(inputs, self._unit)
        self._outputs = _Block(outputs, self._unit)
        self.outputs = self._outputs.values.view()
        self.outputs.flags.writeable = False

    def reset(
        self,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        start_time: float = 0.0,
        stop_time: float | None = None,
        tolerance: float | None = None,
    ) -> None:
        """Start anew with these parameters, all others at their starts and the inputs at zero.

        Raises:
            InputError, UnitError: as for the constructor.
        """
        slave, component = self._slave, self._slave.component
        self._guarded(lambda: slave.fmi2Reset(component))
        self._guarded(lambda: slave.setupExperiment(startTime=start_time, stopTime=stop_time, tolerance=tolerance))
        for name, value in (parameters or {}).items():
            self._set_parameter(name, value)
        self._guarded(lambda: slave.fmi2EnterInitializationMode(component))
        self._guarded(lambda: slave.fmi2ExitInitializationMode(component))
        self._inputs.values[:] = 0.0
        self.time, self._time_rest = start_time, 0.0
        self._read()

    def _set_parameter(self, name: str, value: ArrayLike) -> None:
        slave, component = self._slave, self._slave.component
        variable = self._unit.find(name, Kind.PARAMETER)
        array = _shaped(variable, value)
        references = (fmi2ValueReference * variable.size)(*self._unit.references(variable))
        if variable.boolean:
            flag = (fmi2Boolean * 1)(int(array.item() != 0))
            self._guarded(lambda: slave.fmi2SetBoolean(component, references, 1, flag))
        else:
            reals = (fmi2Real * variable.size)(*array.ravel())
            self._guarded(lambda: slave.fmi2SetReal(component, references, variable.size, reals))

    def set_inputs(self, *, acceleration: ArrayLike | None = None, torque: ArrayLike | None = None) -> None:
        """Set inputs for the steps to come.

        Args:
            acceleration: commanded acceleration of the chaser, (3,), m/s², LVLH.
            torque: torque on the target, (3,), N m, body axes.
        """
        if acceleration is not None:
            self._inputs[_ACCELERATION] = acceleration
        if torque is not None:
            self._inputs[_TORQUE] = torque
        block = self._inputs
        try:
            self._slave.fmi2SetReal(self._slave.component, block.references, block.size, block.pointer)
        except FMICallException as error:
            raise self._error(error) from error

    def step(self, duration: float, *, acceleration: ArrayLike | None = None, torque: ArrayLike | None = None) -> None:
        """Advance by `duration` seconds with the inputs held, then read all outputs.

        Raises:
            UnitError: the duration is not above zero, an input is not finite, or the integration fails; the
                session is as it was before the call.
        """
        if acceleration is not None or torque is not None:
            self.set_inputs(acceleration=acceleration, torque=torque)
        try:
            self._slave.fmi2DoStep(self._slave.component, self.time, duration, 1)
        except FMICallException as error:
            raise self._error(error) from error
        self._advance_time(duration)
        self._read()

    def _advance_time(self, duration: float) -> None:
        """Add to the time without losing its low digits (Kahan's sum): 60,000 tenths are 6,000 s."""
        increment = duration + self._time_rest
        time = self.time + increment
        self._time_rest = increment - (time - self.time)
        self.time = time

    def step_to(self, time: float) -> None:
        """Advance to `time`, s; unlike many calls of `step` this adds up no rounding of the time."""
        self.step(time - self.time)
        self.time, self._time_rest = time, 0.0

    def _read(self) -> None:
        block = self._outputs
        self._slave.fmi2GetReal(self._slave.component, block.references, block.size, block.pointer)

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
        slave, self._slave = self._slave, None
        if slave is not None:
            if slave.component is not None:
                slave.fmi2FreeInstance(slave.component)
            slave.freeLibrary()
        shutil.rmtree(self._unit.folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _log(self, environment: Any, instance: bytes, status: int, category: bytes, message: bytes) -> None:
        self._messages.append(message.decode("utf-8", "replace"))

    def _guarded(self, call: Callable[[], Any]) -> None:
        try:
            call()
        except Exception as error:  # fmpy raises FMICallException, and bare Exceptions on instantiation
            raise self._error(error) from error

    def _error(self, error: Exception) -> UnitError:
        text = "; ".join(self._messages) or str(error)
        self._messages.clear()
        return UnitError(text)


_ACCELERATION, _TORQUE = "chaser.acceleration", "target.torque"


class _Block:
    """The variables of one kind as one flat buffer, with what FMI calls need to fill or read it."""

    def __init__(self, variables: Sequence[Variable], unit: UnitFile):
        references = [reference for variable in variables for reference in unit.references(variable)]
        self.size = len(references)
        self.references = (fmi2ValueReference * self.size)(*references)
        self.values = np.zeros(self.size)
        self.pointer = self.values.ctypes.data_as(ctypes.POINTER(fmi2Real))
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
        array = np.asarray(value, dtype=float)
        if array.shape != view.shape:
            raise InputError(f"{name}: found shape {array.shape}, expected {view.shape}")
        view[...] = array


def _shaped(variable: Variable, value: ArrayLike) -> FloatArray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{variable.name}: found {value!r}, expected numbers") from error
    if array.shape != variable.shape:
        raise InputError(f"{variable.name}: found shape {array.shape}, expected {variable.shape}")
    return array


@dataclass(frozen=True)
class Recording:
    """All outputs of a run at the communication points.

    Attributes:
        time: (n,), s.
        values: (n, size), the flat outputs; `recording[name]` gives one of them as (n, *shape).
    """

    time: FloatArray
    values: FloatArray
    variables: tuple[Variable, ...]

    def __getitem__(self, name: str) -> FloatArray:
        """A view of one output, (n, *shape)."""
        start = 0
        for variable in self.variables:
            if variable.name == name:
                return self.values[:, start : start + variable.size].reshape(-1, *variable.shape)
            start += variable.size
        raise InputError(f"{name}: not an output, expected one of {', '.join(v.name for v in self.variables)}")


def simulate(
    fmu: str | Path,
    times: ArrayLike,
    parameters: Mapping[str, ArrayLike] | None = None,
    *,
    acceleration: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    control: Callable[[Session], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Run the unit over `times` and record every output at each of them.

    Args:
        fmu: an FMU made by `baryscope build` or `build_fmu`.
        times: (n,) increasing communication points, s; the first is the start.
        parameters: values by name; others keep their starts.
        acceleration: constant commanded acceleration of the chaser, (3,), m/s², LVLH.
        torque: constant torque on the target, (3,), N m, body axes.
        control: called before each step with the session, to read outputs and `set_inputs`.
        progress: called now and then with the share of the run that is done, 0 to 1.

    Raises:
        InputError: the times are not increasing, or as for `Session`.
        UnitError: the unit refuses a value or a step.
    """
    points = np.asarray(times, dtype=float)
    if points.ndim != 1 or points.size < 1 or not np.all(np.isfinite(points)) or np.any(np.diff(points) <= 0):
        raise InputError("times: expected a one-dimensional, finite, strictly increasing array of seconds")
    with Session(fmu, parameters, start_time=float(points[0])) as session:
        if acceleration is not None or torque is not None:
            session.set_inputs(acceleration=acceleration, torque=torque)
        values = np.empty((points.size, session.outputs.size))
        values[0] = session.outputs
        report_every = max(1, points.size // 100)
        for index, time in enumerate(points.tolist()[1:], start=1):
            if control is not None:
                control(session)
            session.step_to(time)
            values[index] = session.outputs
            if progress is not None and index % report_every == 0:
                progress(index / (points.size - 1))
        if progress is not None:
            progress(1.0)
        return Recording(points, values, tuple(v for v in session.variables if v.kind == Kind.OUTPUT))
