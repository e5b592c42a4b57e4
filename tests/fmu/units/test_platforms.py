"""The sources of every unit are good C on every platform: names that are its own, no warning."""

import subprocess

import pytest

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.compiler import DEFINITIONS, WARNINGS, find_cross_compiler
from baryscope.fmu.generate.sources import MAIN, interface_headers
from baryscope.fmu.layout.platforms import AARCH64_DARWIN, X86_64_WINDOWS
from baryscope.fmu.units import UNITS, blueprint_of


@pytest.mark.parametrize("platform", [X86_64_WINDOWS, AARCH64_DARWIN], ids=lambda platform: platform.name)
@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "target"])
def test_clang_takes_the_sources(small, tmp_path, unit, platform):
    """macOS' headers declare names that glibc's do not. TumblingTarget is built in full elsewhere, so what LLVM makes
    of such code on these platforms is left out here: it takes two thirds of the time.
    """
    _, sources = describe_unit(blueprint_of(unit, small), 2)
    for name, content in (sources | interface_headers(2)).items():
        (tmp_path / name).write_bytes(content)
    options = ["-target", platform.target, "-std=c11", "-O0", *DEFINITIONS, *WARNINGS, "-I."]
    command = [*find_cross_compiler(), *options, "-emit-llvm", "-c", MAIN, "-o", "unit.bc"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
