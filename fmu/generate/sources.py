"""The C sources of a unit: one file and all it includes, in one flat folder, and apart from them FMI's headers.

Both standards say that units don't ship FMI's headers; whoever compiles the sources brings his own.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from importlib.metadata import distributions
from importlib.resources import files
from pathlib import Path

import fmpy

from baryscope.fmu.layout.platforms import FmiVersion

MAIN = "all.c"
SCENARIO = "scenario.c"  # the file of which alone a scenario's numbers decide
LANGUAGE = "C11"
_INCLUDE = re.compile(rb'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


def unit_sources(generated: Mapping[str, str], fmi: FmiVersion, main: str = MAIN) -> dict[str, bytes]:
    """`main` and all files it includes, from csrc/ and the generated ones, without FMI's headers.

    Args:
        generated: texts by file name; they take precedence.
        fmi: files of the other version, named fmi2… or fmi3…, are left out.
        main: the file to be compiled.
    """
    other = "fmi3" if fmi == 2 else "fmi2"
    written = files("baryscope.fmu") / "csrc"

    def find(name: str) -> bytes | None:
        if name in generated:
            return generated[name].encode()
        for place in (written / name, written / "online" / name):
            if place.is_file():
                return place.read_bytes()
        return None

    found: dict[str, bytes] = {}
    left = [main]
    while left:
        name = left.pop()
        content = None if name.startswith(other) else find(name)
        if content is not None and name not in found:
            found[name] = content
            left.extend(include.decode() for include in _INCLUDE.findall(content))
    return dict(sorted(found.items()))


def interface_headers(fmi: FmiVersion) -> dict[str, bytes]:
    """FMI's headers by name, which fmpy brings."""
    headers = Path(fmpy.__file__).parent / "c-code"
    return {path.name: path.read_bytes() for path in sorted(headers.glob(f"fmi{fmi}*.h"))}


def build_description(model_identifier: str) -> bytes:
    """FMI 3's sources/buildDescription.xml: one file to compile, on every platform.

    The sources prefix their functions, as both standards ask; a shared library's have no prefix.
    """
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model_identifier)
    sources = ET.SubElement(configuration, "SourceFileSet", language=LANGUAGE)
    ET.SubElement(sources, "SourceFile", name=MAIN)
    ET.SubElement(
        sources,
        "PreprocessorDefinition",
        name="FMI3_OVERRIDE_FUNCTION_PREFIX",
        value="1",
        optional="true",
        description="For a shared library: functions without the prefix of the model's name.",
    )
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def licences(headers: Mapping[str, bytes]) -> dict[str, bytes]:
    """The members of documentation/licenses/: our licence, and FMI's, of whose headers a notice stands in one."""
    members: dict[str, bytes] = {}
    for ours in distributions(name="baryscope"):
        text = ours.read_text("licenses/LICENSE")
        if text is not None:
            members["license.txt"] = text.encode()
            break
    for name, content in headers.items():
        notice = re.search(rb"Copyright.*?(?=\*/)", content, re.DOTALL)
        if notice and re.fullmatch(r"fmi\dFunctions\.h", name):
            members[f"{name}.txt"] = notice.group().rstrip() + b"\n"
    return {f"documentation/licenses/{name}": content for name, content in sorted(members.items())}
