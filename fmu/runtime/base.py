"""What all sessions share: one instance of a unit, its parameters, times and saved states."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Self
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.layout.archive import Tables, UnitFile, open_unit
from baryscope.fmu.runtime.instance import Buffer, FlagBuffer, Instance
from baryscope.fmu.runtime.state import SavedState, read_times
from baryscope.models.arguments import array_of, number_of
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath
from baryscope.models.variables import Kind, Variable

SMALLEST_TOLERANCE = 1e-15  # as for the parameter solver.tolerance


class BaseSession:
    """One instance of a unit; see `Session` and `UnitSession`.

    Attributes:
        tables: the units that it opens.
        time: the time reached, s.
        outputs: all real outputs, flat, in the order of the table of variables; read-only, overwritten by each step.
    """

    tables: ClassVar[Tables]

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
            tolerance: tightens that of the unit's integrators, never loosens it.

        Raises:
            InputError: the file is no unit of ours for this machine, or a parameter's name or shape is unknown.
            UnitError: the unit refuses a parameter; the message says why.
        """
        self._unit = open_unit(Path(fmu), self.tables)
        self._instance: Instance | None = None
        self._states: WeakSet[SavedState] = WeakSet()
        try:
            self._instance = Instance(self._unit)
            self._inputs = Block(self._unit.of_kind(Kind.INPUT), self._unit)
            self._outputs = Block(self._unit.of_kind(Kind.OUTPUT), self._unit)
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
        """Start again with these parameters, all others and the inputs at their start values.

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
        self.time, self._time_rest = start, 0.0
        self._read(self._inputs)
        self._read(self._outputs)

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
            self._read(self._outputs)

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

    def _advance_time(self, duration: float) -> None:
        """Add to the time by Kahan's sum, so that 60,000 steps of 0.1 s end at 6,000 s."""
        increment = float(duration) + self._time_rest  # a sum of numpy's short floats would be short, too
        time = self.time + increment
        self._time_rest = increment - (time - self.time)
        self.time = time

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
        self._read(self._inputs)
        self._read(self._outputs)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A copy of an output by its name in the table of variables, in its shape; Booleans as such."""
        variable = self._unit.find(name, Kind.OUTPUT)
        found = self._outputs[variable.name]
        return found.astype(bool) if variable.boolean else found.copy()

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The unit's table of variables."""
        return self._unit.variables

    def _read(self, block: "Block") -> None:
        instance = self.instance
        instance.get(block)
        if block.flags is not None:
            instance.get_booleans(block.flags)

    def close(self) -> None:
        """Free the instance and the unpacked files; closing twice is fine."""
        for state in list(self._states):
            state.close()
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.close()
        self._unit.unpacked.remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Block(Buffer):
    """The variables of one kind: reals in one buffer, Booleans in another, with a view of each by its name."""

    def __init__(self, variables: Sequence[Variable], unit: UnitFile):
        reals = [variable for variable in variables if not variable.boolean]
        flags = [variable for variable in variables if variable.boolean]
        super().__init__(_references(reals, unit), _size(reals), unit.fmi)
        self.flags = FlagBuffer(_references(flags, unit), _size(flags), unit.fmi) if flags else None
        self._views = dict(_views(reals, self.values))
        if self.flags is not None:
            self._views |= _views(flags, self.flags.values)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._views[name]

    def __setitem__(self, name: str, value: ArrayLike) -> None:
        view = self._views[name]
        array = array_of(name, value, view.shape)
        if view.dtype != np.float64 and np.isnan(array).any():
            raise InputError(f"{name}: found nan, expected true or false")
        view[...] = array


def _references(variables: Sequence[Variable], unit: UnitFile) -> list[int]:
    return [reference for variable in variables for reference in unit.references(variable)]


def _size(variables: Sequence[Variable]) -> int:
    return sum(variable.size for variable in variables)


def _views(variables: Sequence[Variable], values: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    start = 0
    for variable in variables:
        yield variable.name, values[start : start + variable.size].reshape(variable.shape)
        start += variable.size
