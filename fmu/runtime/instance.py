"""An instance of the unit of FMI 2 or 3, stepped through fmpy's low-level functions.

fmpy loads the library and declares its functions, which are called with buffers that are allocated once. Two records
hold the differences between FMI 2.0 and 3.0, so that a session is independent of the version.
"""

import ctypes
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

from baryscope.fmu.layout.archive import UnitFile
from baryscope.fmu.layout.platforms import FmiVersion, host_platform, library_of_this_machine
from baryscope.fmu.layout.whole import refuse_cut
from baryscope.fmu.runtime.loading import loaded
from baryscope.models.arguments import number_of
from baryscope.models.errors import ComputationError, InputError

_WARNING = 1


class UnitError(ComputationError):
    """The unit refused a call, or the call failed; the message is the unit's."""


class Buffer:
    """Reals that are read or set together: one flat array, and the arguments of the unit's functions for it.

    Attributes:
        values: the reals.
        arguments: those after the instance.
    """

    def __init__(self, references: Sequence[int], size: int, fmi: FmiVersion):
        self.values = np.zeros(size)
        self._memory = (ctypes.c_uint * len(references))(*references)
        self.arguments: tuple[Any, ...] = (
            ctypes.cast(self._memory, ctypes.POINTER(ctypes.c_uint)),
            len(references),
            self.values.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
        )
        if fmi == 3:
            self.arguments += (size,)


class FlagBuffer:
    """Booleans that are read or set together, as `Buffer`; FMI 2 has them as ints."""

    def __init__(self, references: Sequence[int], size: int, fmi: FmiVersion):
        kind: Any = ctypes.c_bool if fmi == 3 else ctypes.c_int
        self.values = np.zeros(size, dtype=kind)
        self._memory = (ctypes.c_uint * len(references))(*references)
        self.arguments: tuple[Any, ...] = (
            ctypes.cast(self._memory, ctypes.POINTER(ctypes.c_uint)),
            len(references),
            self.values.ctypes.data_as(ctypes.POINTER(kind)),
        )
        if fmi == 3:
            self.arguments += (size,)


LogHandler = Callable[[int, bytes], None]
"""Takes the status and text of a message."""


def _instantiate2(fmu: Any, log: LogHandler) -> None:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *call: log(call[2], call[4]))
    fmu.instantiate(callbacks=callbacks)  # fmpy keeps a reference to them


def _instantiate3(fmu: Any, log: LogHandler) -> None:
    fmu.instantiate(logMessage=lambda environment, status, category, text: log(status, text))


@dataclass(frozen=True)
class _Version:
    """The differences between the versions of FMI.

    Attributes:
        loader: fmpy's class.
        instantiate: creates the instance, with a logger.
        real: name of the type of reals.
        begin: functions that lead to Step Mode; the first takes tolerance, start and stop.
        copy: functions that save, restore and free a state.
        serial: functions for a state's size in bytes, serialisation and deserialisation.
        flag: type of Booleans.
        after: arguments of fmi*SetBoolean after the value.
    """

    loader: Any
    instantiate: Callable[[Any, LogHandler], None]
    real: str
    begin: tuple[str, ...]
    copy: tuple[str, str, str]
    serial: tuple[str, str, str]
    flag: Any
    after: tuple[int, ...]


_VERSIONS: dict[FmiVersion, _Version] = {
    2: _Version(
        FMU2Slave,
        _instantiate2,
        "Real",
        ("SetupExperiment", "EnterInitializationMode", "ExitInitializationMode"),
        ("GetFMUstate", "SetFMUstate", "FreeFMUstate"),
        ("SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate"),
        ctypes.c_int,
        (),
    ),
    3: _Version(
        FMU3Slave,
        _instantiate3,
        "Float64",
        ("EnterInitializationMode", "ExitInitializationMode"),
        ("GetFMUState", "SetFMUState", "FreeFMUState"),
        ("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
        ctypes.c_bool,
        (1,),
    ),
}


class Instance:
    """A Co-Simulation instance, initially in the state Instantiated.

    Every method raises UnitError if the unit refuses the call; the instance is then unchanged.
    """

    def __init__(self, unit: UnitFile):
        """Load an unpacked unit and create an instance.

        Raises:
            InputError: it cannot be loaded on this machine.
            UnitError: it refuses to be instantiated.
        """
        self._messages: list[str] = []
        self._version, self._prefix = _VERSIONS[unit.fmi], f"fmi{unit.fmi}"
        self._fmu = self._load(unit)
        try:
            self._version.instantiate(self._fmu, self._log)
        except Exception as error:  # fmpy raises bare Exceptions
            self._fmu.freeLibrary()
            raise UnitError("; ".join(self._messages) or str(error)) from error
        self._component = self._fmu.component
        self._get = self._function(f"Get{self._version.real}")
        self._set = self._function(f"Set{self._version.real}")
        self._do_step = self._function("DoStep")
        # Outputs of fmi3DoStep: three flags, which this unit never sets, and the time reached.
        types = (ctypes.c_bool, ctypes.c_bool, ctypes.c_bool, ctypes.c_double) if unit.fmi == 3 else ()
        self._answers = tuple(ctypes.POINTER(kind)(kind()) for kind in types)

    def _load(self, unit: UnitFile) -> Any:
        library = library_of_this_machine(unit.folder, unit.model_identifier, unit.fmi)
        expected = "expected a unit for this machine"
        if library is None:
            raise InputError(f"{unit.path}: has no library for {host_platform().name}, {expected}")
        refuse_cut(library, f"{unit.path}: {library.relative_to(unit.folder).as_posix()}")
        try:
            return loaded(
                self._version.loader,
                guid=unit.guid,
                modelIdentifier=unit.model_identifier,
                unzipDirectory=str(unit.folder),
                instanceName="baryscope",
                libraryPath=str(library),
            )
        except Exception as error:  # fmpy raises bare Exceptions
            raise InputError(f"{unit.path}: cannot be loaded ({error}), {expected}") from error

    def reset(self) -> None:
        """Return to the state Instantiated, with all start values."""
        self._call("Reset")

    def initialise(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """Go from Instantiated through Initialization Mode to Step Mode."""
        first, *others = self._version.begin
        self._call(first, tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0)
        for name in others:
            self._call(name)

    def get(self, buffer: Buffer) -> None:
        """Read reals."""
        status = self._get(self._component, *buffer.arguments)
        if status > _WARNING:
            raise self._refusal("Get", status)

    def set(self, buffer: Buffer) -> None:
        """Set reals."""
        status = self._set(self._component, *buffer.arguments)
        if status > _WARNING:
            raise self._refusal("Set", status)

    def get_booleans(self, buffer: FlagBuffer) -> None:
        """Read Booleans."""
        self._call("GetBoolean", *buffer.arguments)

    def set_booleans(self, buffer: FlagBuffer) -> None:
        """Set Booleans."""
        self._call("SetBoolean", *buffer.arguments)

    def set_boolean(self, reference: int, value: bool) -> None:
        """Set one Boolean."""
        references, values = (ctypes.c_uint * 1)(reference), (self._version.flag * 1)(value)
        self._call("SetBoolean", references, 1, values, *self._version.after)

    def step(self, time: float, duration: float) -> None:
        """Advance from `time` by `duration` seconds."""
        try:
            status = self._do_step(self._component, time, duration, False, *self._answers)
        except ctypes.ArgumentError:  # not a float, but maybe a number
            seconds = number_of("duration", duration)
            status = self._do_step(self._component, time, seconds, False, *self._answers)
        if status > _WARNING:
            raise self._refusal("DoStep", status)

    def save(self) -> ctypes.c_void_p:
        """A copy of the instance's state; the caller frees it by `free_state`."""
        state = ctypes.c_void_p()
        self._call(self._version.copy[0], ctypes.byref(state))
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        """Restore a saved state."""
        self._call(self._version.copy[1], state)

    def free_state(self, state: ctypes.c_void_p) -> None:
        """Free a saved state."""
        self._call(self._version.copy[2], ctypes.byref(state))

    def serialise(self, state: ctypes.c_void_p) -> bytes:
        """A saved state as bytes."""
        size = ctypes.c_size_t()
        self._call(self._version.serial[0], state, ctypes.byref(size))
        memory = (ctypes.c_ubyte * size.value)()
        self._call(self._version.serial[1], state, self._bytes(memory), size)
        return bytes(memory)

    def deserialise(self, content: bytes) -> ctypes.c_void_p:
        """A saved state from its bytes."""
        state = ctypes.c_void_p()
        memory = (ctypes.c_ubyte * len(content)).from_buffer_copy(content)
        self._call(self._version.serial[2], self._bytes(memory), len(content), ctypes.byref(state))
        return state

    def _bytes(self, memory: Any) -> Any:
        """Bytes, cast to the type that the library's functions are declared with."""
        return ctypes.cast(memory, self._function(self._version.serial[1]).argtypes[2])

    def close(self) -> None:
        """Free the instance and unload the library."""
        self._function("FreeInstance")(self._component)
        self._fmu.freeLibrary()

    def _function(self, name: str) -> Any:
        return getattr(self._fmu.dll, self._prefix + name)

    def _call(self, name: str, *arguments: Any) -> None:
        status = self._function(name)(self._component, *arguments)
        if status > _WARNING:
            raise self._refusal(name, status)

    def _refusal(self, name: str, status: int) -> UnitError:
        text = "; ".join(self._messages) or f"{self._prefix}{name} failed with status {status}"
        self._messages.clear()
        return UnitError(text)

    def _log(self, status: int, message: bytes) -> None:
        text = message.decode("utf-8", "replace")
        if status > _WARNING:
            self._messages.append(text)
        elif status == _WARNING:
            warnings.warn(text, stacklevel=2)
