"""From a scenario to a packed FMU: generate, describe, compile, zip."""

import hashlib
import tempfile
import warnings
import zipfile
from importlib.resources import as_file, files
from pathlib import Path

import fmpy

from baryscope.fmu.codegen import integrator_header, model_source, tables_header
from baryscope.fmu.compiler import compile_library
from baryscope.fmu.description import MODEL_NAME, model_description
from baryscope.models.files import replacing
from baryscope.models.scenario import Scenario
from baryscope.models.target import tumbling_target

_EPOCH = (1980, 1, 1, 0, 0, 0)  # one date for all members, so that equal contents give equal files


def build_fmu(scenario: Scenario, path: str | Path) -> Path:
    """Build the FMI 2.0 Co-Simulation unit of a scenario for this machine.

    The number of features is built in; every other number of the scenario becomes a start value, which importers
    can change before initialization.

    Args:
        scenario: gives the start values.
        path: where to write; an existing file is replaced when the build has succeeded.

    Returns:
        The path written.

    Raises:
        InputError: the path cannot be written.
        ComputationError: there is no C compiler, or it fails.
    """
    path = Path(path)
    system = tumbling_target(len(scenario.features.points))
    parameters = scenario.flat_parameters()
    equations = model_source(system)

    def description(token: str) -> bytes:
        return model_description(system, parameters, scenario, token)

    def tables(token: str) -> str:
        return tables_header(system, parameters, token)

    with replacing(path) as temporary, as_file(files("baryscope.fmu") / "csrc") as csrc:
        token = _token(equations + integrator_header(), tables(""), description(""), csrc)
        with tempfile.TemporaryDirectory(prefix="baryscope-") as folder:
            build = Path(folder)
            (build / "model.c").write_text(equations, encoding="utf-8")
            (build / "tables.h").write_text(tables(token), encoding="utf-8")
            (build / "dop853.h").write_text(integrator_header(), encoding="utf-8")
            library = build / f"{MODEL_NAME}{fmpy.sharedLibraryExtension}"
            headers = Path(fmpy.__file__).parent / "c-code"
            complaints = compile_library(csrc / "all.c", [build, csrc, headers], library)
            if complaints:
                warnings.warn(f"the C compiler warns: {complaints}", stacklevel=2)
            with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
                _add(archive, "modelDescription.xml", description(token))
                _add(archive, f"binaries/{fmpy.platform}/{library.name}", library.read_bytes(), executable=True)
    return path


def _token(equations: str, tables: str, description: bytes, csrc: Path) -> str:
    """A GUID that changes with whatever the unit is made from."""
    digest = hashlib.sha256(equations.encode() + tables.encode() + description)
    for source in sorted(csrc.glob("*.[ch]")):
        digest.update(source.read_bytes())
    text = digest.hexdigest()
    return f"{{{text[:8]}-{text[8:12]}-{text[12:16]}-{text[16:20]}-{text[20:32]}}}"


def _add(archive: zipfile.ZipFile, name: str, content: bytes, *, executable: bool = False) -> None:
    member = zipfile.ZipInfo(name, date_time=_EPOCH)
    member.compress_type = zipfile.ZIP_DEFLATED
    member.external_attr = (0o755 if executable else 0o644) << 16
    archive.writestr(member, content)
