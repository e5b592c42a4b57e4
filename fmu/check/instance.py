"""An instance of any FMU with one interface for FMI 2 and 3, Co-Simulation and Model Exchange."""

import ctypes
from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import calloc, fmi2, fmi3, free
from numpy.typing import ArrayLike, NDArray

from baryscope.fmu.check.description import size_of, states
from baryscope.fmu.runtime.loading import loaded

FloatArray = NDArray[np.float64]


class RefusedError(Exception):
    """The FMU refused a call; the message holds the call and the FMU's log."""


class Instance:
    """One instance; calls raise `RefusedError` with the unit's log.

    Attributes:
        description: fmpy's reading of modelDescription.xml.
        interface: "CoSimulation" or "ModelExchange".
        allocations: how often the importer's memory functions were called (FMI 2).
    """

    def __init__(self, folder: Path, description: Any, interface: str, token: str | None = None):
        self.description, self.interface = description, interface
        self.fmi2 = description.fmiVersion == "2.0"
        self.co_simulation = interface == "CoSimulation"
        self.allocations = 0
        self._log: list[str] = []
        module = fmi2 if self.fmi2 else fmi3
        kind = getattr(module, f"FMU{2 if self.fmi2 else 3}{'Slave' if self.co_simulation else 'Model'}")
        self.fmu: Any = None
        self._guarded("loading", lambda: self._load(kind, folder, token))
        try:
            self._guarded("instantiation", self._instantiate)
        except RefusedError:
            self.close()
            raise

    def _load(self, kind: Any, folder: Path, token: str | None) -> None:
        identifier = self.description.coSimulation if self.co_simulation else self.description.modelExchange
        self.fmu = loaded(
            kind,
            guid=token or self.description.guid,
            modelIdentifier=identifier.modelIdentifier,
            unzipDirectory=str(folder),
            instanceName="baryscope check",
        )

    def _instantiate(self) -> None:
        if not self.fmi2:
            self.fmu.instantiate(logMessage=lambda *a: self._append(a[3]))
            return

        def allocate(count: int, size: int) -> Any:
            self.allocations += 1
            return calloc(count, size)

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *a: self._append(a[4]))
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(allocate)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        self.fmu.instantiate(callbacks=callbacks)

    def _append(self, message: bytes | None) -> None:
        self._log.append((message or b"").decode("utf-8", "replace"))

    def _guarded(self, what: str, call: Callable[[], Any]) -> Any:
        self._log.clear()
        try:
            return call()
        except Exception as problem:  # fmpy raises bare Exceptions
            raise RefusedError(f"{what} failed: {'; '.join(self._log) or problem}") from problem

    def call(self, name: str, *arguments: Any) -> Any:
        """One of fmpy's methods by name."""
        return self._guarded(name, lambda: getattr(self.fmu, name)(*arguments))

    def close(self) -> None:
        """Free the instance and unload the library, which other instances may still use."""
        fmu, self.fmu = self.fmu, None
        if fmu is None:
            return
        if fmu.component:
            (fmu.fmi2FreeInstance if self.fmi2 else fmu.fmi3FreeInstance)(fmu.component)
        fmu.freeLibrary()

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- life cycle ----

    @property
    def default_start(self) -> float:
        """The start time of the default experiment, else 0."""
        experiment = self.description.defaultExperiment
        return float(experiment.startTime or 0.0) if experiment is not None else 0.0

    def initialise(self, start: float | None = None, stop: float | None = None, tolerance: float | None = None) -> None:
        """Enter Initialization Mode, at the default start time unless another is given."""
        self.time = self.default_start if start is None else start
        if self.fmi2:
            self.call("setupExperiment", tolerance, self.time, stop)
            self.call("enterInitializationMode")
        else:
            self.call("enterInitializationMode", tolerance, self.time, stop)

    def run(self) -> None:
        """Leave Initialization Mode for stepping or, in Model Exchange, for Continuous-Time Mode."""
        self.call("exitInitializationMode")
        if not self.co_simulation:
            self._enter_continuous_time()

    def _enter_continuous_time(self) -> None:
        for _ in range(100):
            if not self._discrete_states_needed():
                break
        self.call("enterContinuousTimeMode")

    def _discrete_states_needed(self) -> bool:
        if not self.fmi2:
            return bool(self.call("updateDiscreteStates")[0])
        info = fmi2.fmi2EventInfo()
        self._guarded(
            "fmi2NewDiscreteStates", lambda: self.fmu.fmi2NewDiscreteStates(self.fmu.component, ctypes.byref(info))
        )
        return bool(info.newDiscreteStatesNeeded)

    def tune(self, parameters: Sequence[Any], values: ArrayLike) -> None:
        """Set tunable parameters in a run: between steps or, in Model Exchange, in Event Mode."""
        if not self.co_simulation:
            self.call("enterEventMode")
        try:
            self.set(parameters, values)
        finally:
            if not self.co_simulation:
                self._enter_continuous_time()

    def restart(self) -> None:
        """Reset, and enter Initialization Mode again."""
        self.call("reset")
        self.initialise()

    def step(self, duration: float) -> tuple[bool, bool, bool, float] | None:
        """One communication step from the current time.

        Returns:
            FMI 3's eventHandlingNeeded, terminateSimulation, earlyReturn and lastSuccessfulTime; None in FMI 2.
        """
        answers: tuple[bool, bool, bool, float] | None = self.call("doStep", self.time, duration)
        self.time += duration
        return answers

    def set_time(self, time: float) -> None:
        """Go to another time (Model Exchange)."""
        self.call("setTime", time)
        self.time = time

    # ---- values ----

    def get(self, variables: Sequence[Any]) -> FloatArray:
        """Values of numeric variables, flat; those of one type are read in one call."""
        sizes = [size_of(variable) for variable in variables]
        values = np.empty(sum(sizes))
        for kind in {variable.type for variable in variables}:
            own = np.repeat([variable.type == kind for variable in variables], sizes)
            members = [variable for variable in variables if variable.type == kind]
            values[own] = self._get(kind, members, int(np.count_nonzero(own)))
        return values

    def _get(self, kind: str, variables: Sequence[Any], size: int) -> Any:
        references = [variable.valueReference for variable in variables]
        name = f"get{_FUNCTION_TYPES.get((self.fmi2, kind), kind)}"
        return self.call(name, references) if self.fmi2 else self.call(name, references, size)

    def set(self, variables: Sequence[Any], values: ArrayLike) -> None:
        """Set numeric variables; neighbours of one type in one call."""
        flat = np.atleast_1d(np.asarray(values, dtype=float)).tolist()
        for kind, group in groupby(variables, key=lambda v: _FUNCTION_TYPES.get((self.fmi2, v.type), v.type)):
            members = list(group)
            count = sum(size_of(member) for member in members)
            part, flat = flat[:count], flat[count:]
            convert: Any = float if kind in ("Real", "Float64", "Float32") else (bool if kind == "Boolean" else int)
            self.call(f"set{kind}", _references(members), [convert(value) for value in part])

    def derivative(self, unknowns: Sequence[Any], knowns: Sequence[Any], seed: ArrayLike) -> FloatArray:
        """A directional derivative."""
        arguments = [_references(unknowns), _references(knowns), np.asarray(seed, dtype=float).tolist()]
        if not self.fmi2:
            arguments.append(sum(size_of(unknown) for unknown in unknowns))
        return np.asarray(self.call("getDirectionalDerivative", *arguments), dtype=float)

    def adjoint(self, unknowns: Sequence[Any], knowns: Sequence[Any], seed: ArrayLike) -> FloatArray:
        """An adjoint derivative (FMI 3)."""
        size = sum(size_of(known) for known in knowns)
        found = self.call(
            "getAdjointDerivative", _references(unknowns), _references(knowns), np.asarray(seed, float).tolist(), size
        )
        return np.asarray(found, dtype=float)

    def output_derivatives(self, outputs: Sequence[Any], order: int) -> FloatArray:
        """Derivatives of outputs by time."""
        references, orders = _references(outputs), [order] * len(outputs)
        if self.fmi2:
            return np.asarray(self.call("getRealOutputDerivatives", references, orders), dtype=float)
        values = (ctypes.c_double * sum(size_of(output) for output in outputs))()
        arguments = (
            (ctypes.c_uint32 * len(outputs))(*references),
            len(outputs),
            (ctypes.c_int32 * len(outputs))(*orders),
            values,
            len(values),
        )
        self._guarded(
            "fmi3GetOutputDerivatives",
            lambda: self.fmu.fmi3GetOutputDerivatives(self.fmu.component, *arguments),
        )
        return np.asarray(values, dtype=float)

    # ---- continuous states, saved states ----

    def get_states(self, rates: bool = False) -> FloatArray:
        """The vector of continuous states, or their derivatives (Model Exchange)."""
        values = np.zeros(self._state_count())
        of_rates = "getDerivatives" if self.fmi2 else "getContinuousStateDerivatives"
        self.call(of_rates if rates else "getContinuousStates", _pointer(values), values.size)
        return values

    def set_states(self, values: FloatArray) -> None:
        """Set the vector of continuous states (Model Exchange)."""
        values = np.ascontiguousarray(values, dtype=float)
        self.call("setContinuousStates", _pointer(values), values.size)

    def _state_count(self) -> int:
        return sum(size_of(state) for state in states(self.description))

    def save(self) -> Any:
        """A saved state."""
        return self.call("getFMUstate" if self.fmi2 else "getFMUState")

    def restore(self, state: Any) -> None:
        """Restore a saved state."""
        self.call("setFMUstate" if self.fmi2 else "setFMUState", state)

    def free_state(self, state: Any) -> None:
        """Free a saved state."""
        self.call("freeFMUstate" if self.fmi2 else "freeFMUState", state)

    def serialise(self, state: Any) -> bytes:
        """A saved state as bytes."""
        return bytes(self.call("serializeFMUstate" if self.fmi2 else "serializeFMUState", state))

    def deserialise(self, content: bytes) -> Any:
        """A saved state from its bytes."""
        return self.call("deSerializeFMUstate" if self.fmi2 else "deserializeFMUState", content)


# The type in the name of the functions where it differs from the variable's; the first key is True for FMI 2.
_FUNCTION_TYPES = {(True, "Enumeration"): "Integer", (False, "Enumeration"): "Int64"}


def _references(variables: Iterable[Any]) -> list[int]:
    return [variable.valueReference for variable in variables]


def _pointer(values: FloatArray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
