"""An importer of FMI 3 units that records the unit's messages and takes names of the table of variables."""

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

from baryscope.models.variables import variable_table
from importer import Listener


class Importer3(Listener):
    """An instance of a unit with 12 features, in the state Instantiated, with its log."""

    kind = FMU3Slave

    def __init__(self, path, folder):
        self.description = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.messages = []
        self.fmu = self.kind(
            guid=self.description.guid,
            modelIdentifier=self.description.modelName,
            unzipDirectory=str(folder),
            instanceName="x",
        )
        self.fmu.instantiate(logMessage=self.hear)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.arrays = "features" in self.references
        self.table = {variable.name: variable for variable in variable_table(12)}

    def hear(self, environment, status, category, message):
        self.messages.append(message.decode())

    def initialise(self, **experiment):
        self.fmu.enterInitializationMode(**experiment)
        self.fmu.exitInitializationMode()

    def of(self, *names):
        """The value references of variables of the table, whole."""
        listed = [[n] if self.arrays else self.table[n].scalar_names for n in names]
        return [self.references[name] for scalars in listed for name in scalars]

    def of_kinds(self, *kinds):
        """The names of the variables of some kinds, Booleans left out."""
        return [v.name for v in self.table.values() if v.kind in kinds and not v.boolean]

    def size(self, *names):
        return sum(self.table[name].size for name in names)

    def get(self, *names):
        return np.array(self.fmu.getFloat64(self.of(*names), self.size(*names)))

    def set(self, name, values):
        self.fmu.setFloat64(self.of(name), np.ravel(values).tolist())

    def step(self, time, duration):
        """Whether an event, the end or an early return is asked for, and the time reached."""
        return self.fmu.doStep(time, duration)
