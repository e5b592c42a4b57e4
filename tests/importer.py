"""An importer of FMI 2 units that records the unit's messages."""

import fmpy
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

    def initialise(self):
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
