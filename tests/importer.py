"""Importers of FMI 2 units: one that records the unit's messages, one that is set, stepped and read with arrays."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

ERROR, DISCARD = 3, 2


class Listener:
    """Records the unit's messages in `messages`."""

    def refused(self, call, *words, status=ERROR):
        """Make the call, see it fail with one new message that contains `words`."""
        before = len(self.messages)
        with pytest.raises(FMICallException) as raised:
            call()
        assert raised.value.status == status
        if words:
            assert len(self.messages) == before + 1
            for word in words:
                assert word in self.messages[-1]


class Importer(Listener):
    """An instance in the state Instantiated, with its log."""

    kind = FMU2Slave

    def __init__(self, path, folder):
        description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.messages = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.messages.append(a[4].decode()))
        self.fmu = self.kind(
            guid=description.guid,
            modelIdentifier=description.modelName,
            unzipDirectory=str(folder),
            instanceName="x",
        )
        self.fmu.instantiate(callbacks=self.callbacks)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.boolean = {v.name for v in description.modelVariables if v.type == "Boolean"}

    def initialise(self, start_time=0.0):
        self.fmu.setupExperiment(startTime=start_time)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()


class Stepped(Importer):
    """An initialised instance: `unit[name]` is an array; keywords are parameters, with `__` for dots."""

    step_size = 1.0
    start_time = 0.0

    def __init__(self, path, folder, **parameters):
        super().__init__(path, folder)
        self._scalars = {}
        for name, value in parameters.items():
            self.set(name.replace("__", "."), value)
        self.initialise(self.start_time)
        self.time = self.start_time

    def scalars(self, name):
        """The names of its elements."""
        if name not in self._scalars:
            self._scalars[name] = [x for x in self.references if x == name or x.startswith(f"{name}[")]
        return self._scalars[name]

    def places(self, name):
        return [self.references[scalar] for scalar in self.scalars(name)]

    def is_boolean(self, name):
        return self.scalars(name)[0] in self.boolean

    def set(self, name, value):
        if self.is_boolean(name):
            self.fmu.setBoolean(self.places(name), np.ravel(value).astype(bool).tolist())
        else:
            self.fmu.setReal(self.places(name), np.ravel(value).astype(float).tolist())

    __setitem__ = set

    def __getitem__(self, name):
        if self.is_boolean(name):
            return np.array(self.fmu.getBoolean(self.places(name)), dtype=bool)
        return np.array(self.fmu.getReal(self.places(name)))

    def step(self, length=None):
        length = self.step_size if length is None else length
        self.fmu.doStep(self.time, length)
        self.time += length
        return self
