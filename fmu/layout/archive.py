"""Packs FMU files; opens them: checks the paths, unpacks, and recognises a unit of ours by its name and variables."""

import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import fmpy

from baryscope.fmu.layout.platforms import FmiVersion
from baryscope.fmu.layout.references import Reference, reference_table
from baryscope.models.errors import InputError
from baryscope.models.files import DISK_TROUBLE, TemporaryFolder, unwritable
from baryscope.models.variables import Kind, Variable

MODEL_NAME = "TumblingTarget"
UNUSED = ("sources/", "documentation/")  # what no unit reads when it runs
_EPOCH = (1980, 1, 1, 0, 0, 0)  # a fixed date, so that equal contents give equal files


@dataclass(frozen=True)
class UnitFile:
    """An unpacked unit.

    Attributes:
        path: the FMU.
        unpacked: where it is unpacked; the caller of `open_unit` removes it.
        fmi: the version of FMI.
        guid: the token shared by description and library.
        model_identifier: stem of the library's name.
        variables: the table of variables for its number of features and its forces.
        table: the value references.
    """

    path: Path
    unpacked: TemporaryFolder
    fmi: FmiVersion
    guid: str
    model_identifier: str
    variables: tuple[Variable, ...]
    table: Sequence[Reference]

    @property
    def folder(self) -> Path:
        """The folder where it is unpacked."""
        return self.unpacked.path

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
        raise InputError(
            f"{name}: not {'a' if kind == Kind.PARAMETER else 'an'} {kind} of the unit, expected one of {names}"
        )

    def references(self, variable: Variable) -> list[int]:
        """The value references of a variable: one for each scalar, or in FMI 3 with arrays a single one."""
        return [place for place, reference in enumerate(self.table) if reference.variable is variable]


Tables = Mapping[str, Callable[[Mapping[str, tuple[int, ...]]], tuple[Variable, ...]]]
"""By a model's name: names and shapes in a modelDescription.xml → the table of variables of the unit they are of."""


def open_unit(path: Path, tables: Tables) -> UnitFile:
    """Unpack an FMU to a temporary folder.

    Args:
        path: the FMU.
        tables: the units that are expected.

    Raises:
        InputError: it cannot be read, is damaged or unsafe, or is none of these units with this version's table.
        DiskError: there is no room to unpack it.
    """
    unpacked = TemporaryFolder()
    try:
        unpack(path, unpacked.path, "an FMU made by `baryscope build`", unused=UNUSED)
        return _describe(path, unpacked, tables)
    except BaseException:
        unpacked.remove()
        raise


def pack(path: Path, members: Mapping[str, bytes], programs: Mapping[str, bytes] | None = None) -> None:
    """Write an archive of files by name, programs last; equal contents give equal archives."""
    executable = programs or {}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (dict(members) | dict(executable)).items():
            member = zipfile.ZipInfo(name, date_time=_EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            member.create_system = 3  # Unix, on every machine; its permissions follow
            member.external_attr = (0o755 if name in executable else 0o644) << 16
            archive.writestr(member, content)


def unpack(path: Path, folder: Path, expected: str, name: str = "", unused: tuple[str, ...] = ()) -> None:
    """Unpack an archive. Errors say that `expected` was expected; members must stay inside `folder`.

    name: of the archive in errors; its path if empty. unused: beginnings of the names of members that are read, as an
    archive has to be whole, and not written: to make their files takes half of the time.

    Raises:
        InputError: it cannot be read, is damaged or encrypted, or holds an unsafe path.
        DiskError: there is no room in the folder.
    """
    source = name or str(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.namelist()
            for member in members:
                parts = PurePosixPath(member).parts
                if member.startswith("/") or "\\" in member or ":" in member or ".." in parts:
                    raise InputError(f"{source}: holds the unsafe path {member!r}, expected {expected}")
            for member in members:
                if member.startswith(unused):
                    archive.read(member)
            archive.extractall(folder, [member for member in members if not member.startswith(unused)])
    except InputError:
        raise
    except zipfile.BadZipFile as error:
        raise InputError(f"{source}: is not a whole zip file ({error}), expected {expected}") from error
    except OSError as error:
        if error.errno in DISK_TROUBLE:  # it can be read, but what is in it cannot be written
            raise unwritable(folder, error) from error
        raise InputError(f"{source}: {error.strerror or error}, expected {expected}") from error
    except Exception as error:  # of zlib or lzma; zipfile's own for passwords, compressions and names it cannot read
        raise InputError(f"{source}: cannot be unpacked ({error}), expected {expected}") from error


def _describe(path: Path, unpacked: TemporaryFolder, tables: Tables) -> UnitFile:
    try:
        description = fmpy.read_model_description(str(unpacked.path), validate=False)
    except Exception as error:  # fmpy raises bare Exceptions
        raise InputError(f"{path}: modelDescription.xml cannot be read ({error})") from error
    kind = f"{description.modelName} of FMI {description.fmiVersion}"
    fmi = _VERSIONS.get(description.fmiVersion)
    if description.modelName not in tables or fmi is None or description.coSimulation is None:
        raise InputError(f"{path}: is {kind}, expected {' or '.join(tables)} of FMI 2.0 or 3.0 for Co-Simulation")
    described = [(v.name, v.shape or ()) for v in description.modelVariables]
    variables = tables[description.modelName](dict(described))
    table = _references(path, fmi, variables, described)
    identifier = description.coSimulation.modelIdentifier
    return UnitFile(path, unpacked, fmi, description.guid, identifier, variables, table)


_VERSIONS: dict[str, FmiVersion] = {"2.0": 2, "3.0": 3}


def _references(
    path: Path, fmi: FmiVersion, variables: Sequence[Variable], described: Sequence[tuple[str, tuple[int, ...]]]
) -> list[Reference]:
    """The table of references, with arrays or scalars, that matches names and shapes in a modelDescription.xml."""
    for scalar in (False, True):
        table = reference_table(variables, fmi, scalar)
        expected = [(r.name, r.shape) for r in table] + ([("time", ())] if fmi == 3 else [])
        if described == expected:
            return table
    raise InputError(f"{path}: its variables are not those of this version of baryscope; build it again")
