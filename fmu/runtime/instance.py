"""An instance of the unit, stepped through fmpy's low-level functions, of either version of FMI.

fmpy loads the library and declares its functions; they are called as it has loaded them, with buffers allocated once.
What differs between FMI 2.0 and 3.0 stands in two records, so that a session need not know the version.
"""

import ctypes
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

from baryscope.fmu.layout.archive import UnitFile
from baryscope.fmu.layout.platforms import FmiVersion, host_platform, library_of_this_machine
from baryscope.fmu.runtime.arguments import number_of
from baryscope.models.errors import ComputationError, InputError

_WARNING = 1


class UnitError(ComputationError):
    """The unit refused a call or could not carry it out; the message is the unit's own."""


class Buffer:
    """Reals to be read or set together: one flat array, with what the unit's functions need to fill or read it.

    Attributes:
        values: the reals.
        arguments: what the functions take after the instance.
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


Hear = Callable[[int, bytes], None]
"""Takes the status and the text of a message."""


def _instantiate2(fmu: Any, hear: Hear) -> None:
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *call: hear(call[2], call[4]))
    fmu.instantiate(callbacks=callbacks)  # fmpy keeps them


def _instantiate3(fmu: Any, hear: Hear) -> None:
    fmu.instantiate(logMessage=lambda environment, status, category, text: hear(status, text))


@dataclass(frozen=True)
class _Version:
    """What differs between the versions: spellings, and what some functions take.

    Attributes:
        loader: fmpy's class.
        instantiate: makes the instance, with a logger.
        real: the name of the type of reals.
        begin: the functions that lead into Step Mode; the first takes tolerance, start and stop.
        copy: the functions that make a copy of the state, put it back and free it.
        serial: the functions that give a copy's size, turn it into bytes, and back.
        flag: type of Booleans.
        after: what fmi*SetBoolean takes after its value.
    """

    loader: Any
    instantiate: Callable[[Any, Hear], None]
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
    """A Co-Simulation instance, at first in the state Instantiated.

    Every method raises UnitError where the unit refuses the call; the instance is then as it was before.
    """

    def __init__(self, unit: UnitFile):
        """Load an unpacked unit and make an instance.

        Raises:
            InputError: it cannot be loaded on this machine.
            UnitError: it refuses to be instantiated.
        """
        self._messages: list[str] = []
        self._version, self._prefix = _VERSIONS[unit.fmi], f"fmi{unit.fmi}"
        self._fmu = self._load(unit)
        try:
            self._version.instantiate(self._fmu, self._hear)
        except Exception as error:  # fmpy raises bare Exceptions
            self._fmu.freeLibrary()
            raise UnitError("; ".join(self._messages) or str(error)) from error
        self._component = self._fmu.component
        self._get = self._function(f"Get{self._version.real}")
        self._set = self._function(f"Set{self._version.real}")
        self._do_step = self._function("DoStep")
        # What fmi3DoStep tells: three flags, which this unit never raises, and the time reached.
        types = (ctypes.c_bool, ctypes.c_bool, ctypes.c_bool, ctypes.c_double) if unit.fmi == 3 else ()
        self._answers = tuple(ctypes.POINTER(kind)(kind()) for kind in types)

    def _load(self, unit: UnitFile) -> Any:
        library = library_of_this_machine(unit.folder, unit.model_identifier, unit.fmi)
        expected = "expected a unit for this machine"
        if library is None:
            raise InputError(f"{unit.path}: has no library for {host_platform().name}, {expected}")
        here = Path.cwd()
        try:
            return self._version.loader(
                guid=unit.guid,
                modelIdentifier=unit.model_identifier,
                unzipDirectory=str(unit.folder),
                instanceName="baryscope",
                libraryPath=str(library),
            )
        except Exception as error:  # as above
            os.chdir(here)  # fmpy goes to the library's folder, and stays there if it cannot be loaded
            raise InputError(f"{unit.path}: cannot be loaded ({error}), {expected}") from error

    def reset(self) -> None:
        """Back to Instantiated with all starts."""
        self._call("Reset")

    def initialise(self, start: float, stop: float | None, tolerance: float | None) -> None:
        """Pass through Initialization Mode, from Instantiated to Step Mode."""
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
        """A copy of the instance's state, to be given to `forget` in the end."""
        state = ctypes.c_void_p()
        self._call(self._version.copy[0], ctypes.byref(state))
        return state

    def restore(self, state: ctypes.c_void_p) -> None:
        """Put a copy back."""
        self._call(self._version.copy[1], state)

    def forget(self, state: ctypes.c_void_p) -> None:
        """Free a copy."""
        self._call(self._version.copy[2], ctypes.byref(state))

    def serialise(self, state: ctypes.c_void_p) -> bytes:
        """A copy as bytes."""
        size = ctypes.c_size_t()
        self._call(self._version.serial[0], state, ctypes.byref(size))
        memory = (ctypes.c_ubyte * size.value)()
        self._call(self._version.serial[1], state, self._bytes(memory), size)
        return bytes(memory)

    def deserialise(self, content: bytes) -> ctypes.c_void_p:
        """A copy from its bytes."""
        state = ctypes.c_void_p()
        memory = (ctypes.c_ubyte * len(content)).from_buffer_copy(content)
        self._call(self._version.serial[2], self._bytes(memory), len(content), ctypes.byref(state))
        return state

    def _bytes(self, memory: Any) -> Any:
        """Bytes as the library's functions are declared to take them."""
        return ctypes.cast(memory, self._function(self._version.serial[1]).argtypes[2])

    def close(self) -> None:
        """Free the instance and let go of the library."""
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

    def _hear(self, status: int, message: bytes) -> None:
        if status > _WARNING:
            self._messages.append(message.decode("utf-8", "replace"))
