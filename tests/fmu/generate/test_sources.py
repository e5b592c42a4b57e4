"""The sources in a unit, compiled by others: with their definitions, headers, prefixes and compilers."""

import ast
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.util import create_cmake_project

from baryscope.fmu import Session, build_fmu
from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.codegen import c_text
from baryscope.fmu.generate.compiler import find_compiler
from baryscope.fmu.units import UNITS, blueprint_of
from compiling import compiled

DRIVER = Path(__file__).with_name("linked_unit.c")
HEADERS = Path(fmpy.__file__).parent / "c-code"


@pytest.fixture(params=["small_fmu", "small_fmu3"], ids=["fmi2", "fmi3"])
def unit(request):
    return request.getfixturevalue(request.param)


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
    """As `fmpy create-cmake-project` writes it; its unit makes the same numbers.

    Without optimisation: with it, what importers compile is in test_build.py.
    """
    cmake = cmake_with_a_compiler(monkeypatch)
    folder = tmp_path / "project"
    folder.mkdir()
    create_cmake_project(str(unit), str(folder))
    shutil.rmtree(folder / "binaries")
    (folder / "binaries").mkdir()
    build = [cmake, "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_COMPILE_WARNING_AS_ERROR=ON"]
    for command in (build, [cmake, "--build", "build", "--config", "Debug"]):
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
    compiled(tmp_path / "sources", *options, "-fsyntax-only", "all.c")


def test_headers_of_fmi_are_the_importers(unit):
    with zipfile.ZipFile(unit) as archive:
        names = [Path(name).name for name in archive.namelist()]
    assert "all.c" in names
    assert not set(names) & {path.name for path in HEADERS.iterdir()}


def standard_headers(folder):
    """FMI's headers; fmpy's for FMI 2 have lost the prefix, says a comment in them."""
    shutil.copytree(HEADERS, folder)
    header = folder / "fmi2Functions.h"
    lost, standard = "#define fmi2FullName(name) name", (
        "#define fmi2Paste(a, b) a##b\n#define fmi2PasteB(a, b) fmi2Paste(a, b)\n"
        "#ifdef FMI2_FUNCTION_PREFIX\n#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)\n"
        "#else\n#define fmi2FullName(name) name\n#endif"
    )  # fmt: skip
    text = header.read_text(encoding="utf-8")
    assert text.count(lost) == 1
    header.write_text(text.replace(lost, standard), encoding="utf-8")
    return f"-I{folder}"


LINKED = [] if sys.platform == "win32" else ["-lm"]
STEPS, STEP = 20, 0.5  # s
MAIN = """
#include <stdio.h>
int run_one(const char *, unsigned, int, double, double *, size_t);
int run_other(const char *, unsigned, int, double, double *, size_t);
int main(int argc, char **argv)
{
    double values[8];
    if (argc != 3 || run_one(argv[1], FIRST, STEPS, STEP, values, 4)) return 1;
    if (run_other(argv[2], FIRST, STEPS, STEP, values + 4, 4)) return 1;
    for (int i = 0; i < 8; i++) printf("%.17g\\n", values[i]);
    return 0;
}
"""


def linked_attitudes(folder, one, other, *options):
    """The attitudes after STEPS steps of two units in one program.

    The first has the prefix of its model's name, the other one of the importer's choice, and compiler options.
    """
    headers, tokens = standard_headers(folder / "headers"), []
    for name, path, prefix in (("one", one, "TumblingTarget_"), ("other", other, "Other_")):
        description = fmpy.read_model_description(str(path))
        fmi = int(description.fmiVersion[0])
        attitude = [v for v in description.modelVariables if v.name.startswith("target.attitude") and "0" not in v.name]
        fmpy.extract(str(path), str(folder / name))
        defined = [f"-DFMI{fmi}_FUNCTION_PREFIX={prefix}"]
        own = [*defined, *options] if name == "other" else []
        compiled(folder / name / "sources", "-ffp-contract=off", headers, *own, "-c", "all.c", "-o", "unit.o")
        driver = [*defined, f"-DVERSION={fmi}", f"-DRUN=run_{name}", headers, "-c", str(DRIVER)]
        compiled(folder, *driver, "-o", f"{name}.o")
        tokens.append(description.guid if fmi == 2 else description.instantiationToken)
    (folder / "main.c").write_text(MAIN)
    numbers = [f"-DFIRST={attitude[0].valueReference}", f"-DSTEPS={STEPS}", f"-DSTEP={STEP}"]
    objects = ["one.o", "other.o", "one/sources/unit.o", "other/sources/unit.o"]
    compiled(folder, *numbers, "main.c", *objects, "-o", "program", *LINKED)
    result = subprocess.run([folder / "program", *tokens], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return np.array(result.stdout.split(), dtype=float).reshape(2, 4)


def test_two_units_in_one_program(unit, small, tmp_path):
    target = small.target.model_copy(update={"angular_rate_deg": (1.0, 3.0, 2.0)})
    fmi = int(fmpy.read_model_description(str(unit)).fmiVersion[0])
    other = build_fmu(small.model_copy(update={"target": target}), tmp_path / "other.fmu", fmi=fmi)
    found = linked_attitudes(tmp_path, unit, other)
    assert not np.allclose(found[0], found[1])
    for path, attitude in zip((unit, other), found, strict=True):
        with Session(path) as session:
            session.step(STEPS * STEP)
            np.testing.assert_allclose(attitude, session["target.attitude"], rtol=1e-10, atol=1e-10)


def test_compilers_without_gnu_extensions_make_the_same_numbers(small, tmp_path):
    """Under gravity gradient, where most of the extensions are used."""
    target = small.target.model_copy(update={"gravity_gradient": True})
    path = build_fmu(small.model_copy(update={"target": target}), tmp_path / "turning.fmu")
    one, other = linked_attitudes(tmp_path, path, path, "-DPLAIN_C", "-Wpedantic")
    assert np.array_equal(one, other)


def test_gnu_extensions_are_in_one_file(unit):
    with zipfile.ZipFile(unit) as archive:
        sources = {name: archive.read(name) for name in archive.namelist() if name.startswith("sources/")}
    found = {
        Path(name).name for name, text in sources.items() if re.search(rb"_Pragma|#\s*pragma|__builtin|\[\[", text)
    }
    generated = rb"#elif defined\(__GNUC__\).*\n.*__attribute__"  # CasADi's, guarded
    found |= {Path(name).name for name, text in sources.items() if b"__attribute__" in re.sub(generated, b"", text)}
    assert found == {"dialect.h"}


@pytest.mark.parametrize(("unit_name", "fmi"), [*((name, 2) for name in UNITS), ("target", 3), ("rig", 3)])
def test_compilers_warn_of_nothing(small, tmp_path, unit_name, fmi):
    """They did of functions that CasADi writes for other programs, and of those that another unit or version has."""
    _, sources = describe_unit(blueprint_of(unit_name, small), fmi)
    for name, content in sources.items():
        (tmp_path / name).write_bytes(content)
    told = ["-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", f"-I{HEADERS}", "-c", "all.c", "-o", "all.o"]
    done = subprocess.run([*find_compiler(), *told], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("unit_name", UNITS)
def test_compilers_of_other_makes_can_read_them(small, tmp_path, unit_name):
    """C99 but for one thing, which C23 allows: a pointer to an array of numbers that becomes one of const numbers.

    They make nothing of it here: what they complain of, they do as they read. No text depends on a compiler's encoding
    of sources: MSVC's is the machine's, where UTF-8 may hide a line's end.
    """
    _, sources = describe_unit(blueprint_of(unit_name, small), 2)
    for name, content in sources.items():
        (tmp_path / name).write_bytes(content)
        assert content.isascii(), name
    options = ["-DPLAIN_C", "-std=c99", "-Wpedantic", "-Wvla", "-Wno-error", f"-I{HEADERS}"]
    messages = compiled(tmp_path, *options, "-fsyntax-only", "all.c")
    warnings = [line for line in messages.splitlines() if "warning:" in line and "different qualifiers" not in line]
    assert not warnings
    compiled(tmp_path, "-DPLAIN_C", "-std=c2x", "-pedantic-errors", f"-I{HEADERS}", "-fsyntax-only", "all.c")


def test_texts_of_checks_are_utf_8():
    text = 'm³/s² "≤"\\'
    literal = c_text(text)
    assert literal.isascii()
    assert ast.literal_eval(f"b{literal}").decode() == text


def test_fast_math_is_refused(small_fmu, tmp_path):
    """A unit compiled so took NaN for a number."""
    fmpy.extract(str(small_fmu), str(tmp_path))
    with pytest.raises(AssertionError, match="-ffast-math and -ffinite-math-only take away the checks"):
        compiled(tmp_path / "sources", "-ffast-math", f"-I{HEADERS}", "-c", "all.c", "-o", "all.o")
