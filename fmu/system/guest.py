"""A unit of another tool in the place of one of ours: what it has of the variables by which the chain connects ours."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import fmpy

from baryscope.fmu.layout.archive import unpack
from baryscope.fmu.layout.measures import Measure, measure_of, measures_of
from baryscope.fmu.layout.whole import refuse_cut_unit
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, temporary_folder
from baryscope.models.variables import UNITS, Kind, Variable

EXPECTED = "an FMU of FMI 2.0 for Co-Simulation"
_CAUSALITIES = {Kind.INPUT: "input", Kind.OUTPUT: "output", Kind.PARAMETER: "parameter"}


@dataclass(frozen=True, eq=False)
class Guest:
    """Another tool's unit.

    Attributes:
        path: the FMU.
        summary: its description, or the name of its model.
        scalars: names of its variables → their causality and type.
        measures: names of its variables → their units, of those that have one.
    """

    path: Path
    summary: str
    scalars: dict[str, tuple[str, str]]
    measures: dict[str, Measure]

    def has(self, variable: Variable) -> bool:
        """Whether it has a variable of ours, by the names of its scalars, in the same role.

        Raises:
            InputError: it has only some of the scalars, or one of another type, or in another unit.
        """
        causality = _CAUSALITIES[variable.kind]
        names = variable.scalar_names
        missing = [name for name in names if self.scalars.get(name, ("",))[0] != causality]
        if len(missing) == len(names):
            return False
        kind = "Boolean" if variable.boolean else "Real"
        if missing:
            raise InputError(f"{self.path}: has no {causality} {missing[0]}, expected all of {variable.name}, or none")
        expected = measure_of(variable.unit, UNITS.get(variable.unit))
        for name in names:
            found = self.scalars[name][1]
            if found != kind:
                raise InputError(f"{self.path}: {name} is of type {found}, expected {kind}")
            measure = self.measures.get(name)
            if measure is not None and not measure.is_same(expected):
                raise InputError(f'{self.path}: {name} is in "{measure.name}", expected "{expected.name}"')
        return True

    def require(self, variables: Iterable[Variable]) -> None:
        """Refuse a unit that lacks one of these.

        Raises:
            InputError: names all that are missing.
        """
        missing = [variable for variable in variables if not self.has(variable)]
        if missing:
            scalars = ", ".join(name for variable in missing for name in variable.scalar_names)
            raise InputError(f"{self.path}: has no {missing[0].kind} {scalars}, expected what the chain connects")


def read_guest(path: AnyPath) -> Guest:
    """The unit in a file.

    Raises:
        InputError: it cannot be read, is unsafe, is cut off, or is no FMU of FMI 2.0 for Co-Simulation.
    """
    path = Path(path)
    with temporary_folder() as folder:
        unpack(path, folder, EXPECTED)
        try:
            description = fmpy.read_model_description(str(folder), validate=False)
        except Exception as error:  # fmpy raises bare Exceptions
            raise InputError(f"{path}: {' '.join(str(error).split())}, expected {EXPECTED}") from error
        if description.fmiVersion != "2.0" or description.coSimulation is None:
            how = "" if description.coSimulation else ", without Co-Simulation"
            raise InputError(f"{path}: is of FMI {description.fmiVersion}{how}, expected {EXPECTED}")
        refuse_cut_unit(folder, description.coSimulation.modelIdentifier, str(path))
    scalars = {variable.name: (variable.causality, variable.type) for variable in description.modelVariables}
    return Guest(path, description.description or description.modelName, scalars, measures_of(description))
