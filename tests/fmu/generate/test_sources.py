"""The sources in a unit, compiled by others: with their definitions, headers, prefixes and compilers."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.util import create_cmake_project

from baryscope.fmu.generate.compiler import WARNINGS, find_compiler

HEADERS = Path(fmpy.__file__).parent / "c-code"


@pytest.fixture(params=["small_fmu", "small_fmu3"], ids=["fmi2", "fmi3"])
def unit(request):
    return request.getfixturevalue(request.param)


def compiled(folder, *arguments):
    """Run the compiler that the unit is built with; warnings are errors."""
    result = subprocess.run(
        [*find_compiler(), "-std=c11", *WARNINGS, "-Werror", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr


def cmake_with_a_compiler(monkeypatch):
    """The command of cmake, which fmpy brings, with zig where the machine has no compilers for C and C++."""
    here = Path(sys.executable).parent
    monkeypatch.setenv("PATH", f"{here}{os.pathsep}{os.environ['PATH']}")
    if shutil.which("cc") is None or shutil.which("c++") is None:
        monkeypatch.setenv("CC", f"{here / 'python-zig'} cc")
        monkeypatch.setenv("CXX", f"{here / 'python-zig'} c++")
    cmake = shutil.which("cmake")
    assert cmake is not None
    return cmake


def test_a_project_of_fmpy_compiles(unit, tmp_path, monkeypatch):
    """As `fmpy create-cmake-project` writes it; its unit makes the same numbers."""
    cmake = cmake_with_a_compiler(monkeypatch)
    folder = tmp_path / "project"
    folder.mkdir()
    create_cmake_project(str(unit), str(folder))
    shutil.rmtree(folder / "binaries")
    (folder / "binaries").mkdir()
    build = [cmake, "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_COMPILE_WARNING_AS_ERROR=ON"]
    for command in (build, [cmake, "--build", "build", "--config", "Release"]):
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stdout + result.stderr
    own, theirs = (
        fmpy.simulate_fmu(str(path), stop_time=100.0, output_interval=10.0)
        for path in (unit, folder / "TumblingTarget.fmu")
    )
    assert own.dtype == theirs.dtype
    for name in own.dtype.names:
        np.testing.assert_allclose(theirs[name], own[name], rtol=1e-10, atol=1e-10)


def test_definitions_of_an_importer_do_no_harm(unit, tmp_path):
    """The names that fmpy's project defines, with the compiler that every machine with these tests has."""
    fmpy.extract(str(unit), str(tmp_path))
    options = ["-DMODEL_EXCHANGE", "-DCO_SIMULATION", f"-I{HEADERS}"]
    compiled(tmp_path / "sources", *options, "-c", "all.c", "-o", "all.o")
