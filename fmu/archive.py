"""Opening an FMU file: unpacked with its paths checked, and recognised as one of ours by its variables."""

import shutil
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import fmpy

from baryscope.fmu.description import MODEL_NAME
from baryscope.models.errors import InputError
from baryscope.models.variables import Kind, Variable, variable_table


@dataclass(frozen=True)
class UnitFile:
    """An unpacked unit.

    Attributes:
        path: the FMU it came from.
        folder: where it was unpacked; whoever opened it removes it.
        guid: ties description and library together.
        model_identifier: stem of the library's name.
        variables: the table of variables for its number of features.
    """

    path: Path
    folder: Path
    guid: str
    model_identifier: str
    variables: tuple[Variable, ...]

    def of_kind(self, kind: Kind) -> list[Variable]:
        """The variables of one kind, in order."""
        return [variable for variable in self.variables if variable.kind == kind]

    def find(self, name: str, kind: Kind) -> Variable:
        """The variable of a name.

        Raises:
            InputError: there is none of that kind.
        """
        for variable in self.variables:
            if variable.name == name and variable.kind == kind:
                return variable
        names = ", ".join(variable.name for variable in self.of_kind(kind))
        raise InputError(f"{name}: not a {kind} of the unit, expected one of {names}")

    def references(self, variable: Variable) -> range:
        """The value references of a variable's scalars."""
        start = 0
        for other in self.variables:
            if other is variable:
                break
            start += other.size
        return range(start, start + variable.size)


def open_unit(path: Path) -> UnitFile:
    """Unpack an FMU to a temporary folder.

    Raises:
        InputError: it cannot be read, is damaged or unsafe, or is not a TumblingTarget of this version's table.
    """
    folder = Path(tempfile.mkdtemp(prefix="baryscope-"))
    try:
        _unpack(path, folder)
        return _describe(path, folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _unpack(path: Path, folder: Path) -> None:
    expected = "an FMU made by `baryscope build`"
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                parts = PurePosixPath(name).parts
                if name.startswith("/") or "\\" in name or ":" in name or ".." in parts:
                    raise InputError(f"{path}: holds the unsafe path {name!r}, expected {expected}")
            archive.extractall(folder)
    except zipfile.BadZipFile as error:
        raise InputError(f"{path}: is not a whole zip file ({error}), expected {expected}") from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}, expected {expected}") from error


def _describe(path: Path, folder: Path) -> UnitFile:
    try:
        description = fmpy.read_model_description(str(folder), validate=False)
    except Exception as error:  # fmpy raises bare Exceptions
        raise InputError(f"{path}: modelDescription.xml cannot be read ({error})") from error
    kind = f"{description.modelName} of FMI {description.fmiVersion}"
    if description.modelName != MODEL_NAME or description.fmiVersion != "2.0" or description.coSimulation is None:
        raise InputError(f"{path}: is {kind}, expected {MODEL_NAME} of FMI 2.0 for Co-Simulation")
    names = [variable.name for variable in description.modelVariables]
    table = variable_table(sum(name.startswith("features[") for name in names) // 3)
    if names != [name for variable in table for name in variable.scalar_names]:
        raise InputError(f"{path}: its variables are not those of this version of baryscope; build it anew")
    return UnitFile(path, folder, description.guid, description.coSimulation.modelIdentifier, table)
