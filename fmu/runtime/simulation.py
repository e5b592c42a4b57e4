"""Runs the unit over given times and records all outputs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.runtime.session import Session
from baryscope.models.arguments import array_of
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.variables import Kind, Variable
from baryscope.models.words import counted

FloatArray = NDArray[np.float64]


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

    def __repr__(self) -> str:
        """What is recorded, in a line."""
        span = f" from {self.time[0]:g} to {self.time[-1]:g} s" if len(self.time) else ""
        return f"<Recording: {counted(len(self.time), 'time')}{span}, {counted(len(self.variables), 'variable')}>"

    def __getitem__(self, name: str) -> FloatArray:
        """A view of one output, (n, *shape)."""
        start = 0
        for variable in self.variables:
            if variable.name == name:
                return self.values[:, start : start + variable.size].reshape(-1, *variable.shape)
            start += variable.size
        raise InputError(f"{name}: not an output, expected one of {', '.join(v.name for v in self.variables)}")


def simulate(
    fmu: AnyPath,
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
        fmu: an FMU made by `baryscope build` or `build_fmu`, of FMI 2 or 3.
        times: (n,) increasing communication points, s; the first is the start.
        parameters: values by name; others keep their starts.
        acceleration: constant commanded acceleration of the chaser, (3,), m/s², LVLH.
        torque: constant torque on the target, (3,), N m, body axes.
        control: called before each step with the session, to read outputs and `set_inputs`.
        progress: called about 100 times with the share of the run that is done, 0 to 1.

    Raises:
        InputError: the times are not increasing, or as for `Session`.
        UnitError: the unit refuses a value or a step.
    """
    points = array_of("times", times)
    increasing = points.ndim == 1 and points.size > 0 and np.all(points[1:] > points[:-1])
    if not increasing or not np.all(np.isfinite(points)):
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
