"""The FMU file: valid, complete, reproducible, and buildable with more than one compiler."""

import os
import re
import shlex
import shutil
import sys
import warnings
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu

from baryscope.fmu import Session, build_fmu
from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.compiler import find_compiler
from baryscope.fmu.generate.sources import build_description
from baryscope.fmu.units.target import target_blueprint
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.target import tumbling_target
from baryscope.models.variables import Kind
from importer import Importer


@pytest.fixture(scope="module")
def description(envisat_fmu):
    with zipfile.ZipFile(envisat_fmu) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))  # noqa: S314  our own file


def test_fmpy_validates_it_without_a_message(envisat_fmu):
    assert validate_fmu(str(envisat_fmu)) == []


def test_fmpy_simulates_it(envisat, envisat_fmu):
    result = fmpy.simulate_fmu(str(envisat_fmu), stop_time=10.0, output_interval=1.0, output=["target.position[2]"])
    with Session(envisat_fmu) as session:
        session.step(10.0)
        assert result["target.position[2]"][-1] == pytest.approx(session.position[1], abs=1e-9)


def test_every_variable_of_the_table_is_described(envisat, description):
    table = tumbling_target(len(envisat.features.points)).variables
    scalars = description.find("ModelVariables")
    assert [s.get("name") for s in scalars] == [name for v in table for name in v.scalar_names]
    assert [int(s.get("valueReference")) for s in scalars] == list(range(len(scalars)))
    assert all(s.get("description") for s in scalars)
    units = {unit.get("name") for unit in description.find("UnitDefinitions")}
    assert all(s[0].get("unit") in units for s in scalars if s[0].tag == "Real")
    assert description.get("variableNamingConvention") == "structured"


def test_starts_have_all_digits(envisat, description):
    starts = [s[0].get("start") for s in description.find("ModelVariables") if s.get("causality") == "parameter"]
    values = [{"true": 1.0, "false": 0.0}.get(text, text) for text in starts]
    assert np.array_equal(np.array(values, dtype=float), envisat.flat_parameters())


def _declared(description, element):
    """Pairs of an unknown and a known, as indices of variables from 0."""
    return {
        (int(unknown.get("index")) - 1, int(known) - 1)
        for unknown in description.find(f"ModelStructure/{element}")
        for known in unknown.get("dependencies").split()
    }


def _places(system, *kinds):
    places = [kind for variable in system.variables for kind in [variable.kind] * variable.size]
    return [index for index, kind in enumerate(places) if kind in kinds]


def _not_zero(function, arguments, rows, columns):
    """Pairs of rows and columns where a Jacobian is not zero at random arguments near the given ones."""
    rng = np.random.default_rng(5)
    shaken = [
        value * (1 + 1e-2 * rng.normal(size=value.size)) + 1e-3 * rng.normal(size=value.size) for value in arguments
    ]
    return {(rows[i], columns[j]) for i, j in np.argwhere(np.array(function(*shaken)))}


def test_dependencies_are_those_of_the_derivatives(envisat, description):
    """Against CasADi's Jacobians at random points: what is not declared is zero, and little is declared in vain."""
    system = tumbling_target(len(envisat.features.points))
    x, u, p = (ca.SX.sym(name, system.rhs.numel_in(index)) for index, name in enumerate("xup"))
    p0, u0 = envisat.flat_parameters(), np.zeros(6)
    p0[-2] = 1.0  # with gravity gradient, so that what it brings is not multiplied by zero
    x0 = np.array(system.initial(p0)).ravel()

    run = ca.vertcat(system.outputs(x, p), system.rhs(x, u, p))
    jacobian = ca.Function("j", [x, u, p], [ca.jacobian(run, ca.vertcat(u, x))])
    rows, columns = _places(system, Kind.OUTPUT, Kind.DERIVATIVE), _places(system, Kind.INPUT, Kind.STATE)
    found = _not_zero(jacobian, [x0, u0, p0], rows, columns)
    declared = _declared(description, "Outputs") | _declared(description, "Derivatives")
    assert found <= declared
    assert len(declared - found) <= 0.02 * len(declared)

    start = system.initial(p)
    first = ca.vertcat(system.outputs(start, p), start, system.rhs(start, u, p))
    jacobian = ca.Function("j", [u, p], [ca.jacobian(first, ca.vertcat(u, p))])
    rows = _places(system, Kind.OUTPUT, Kind.STATE, Kind.DERIVATIVE)
    found = _not_zero(jacobian, [u0, p0], rows, _places(system, Kind.INPUT, Kind.PARAMETER))
    declared = _declared(description, "InitialUnknowns")
    assert found <= declared
    assert len(declared - found) <= 0.02 * len(declared)


def test_derivatives_name_their_states(description):
    scalars = list(description.find("ModelVariables"))
    derivatives = [s for s in scalars if s[0].get("derivative")]
    assert len(derivatives) == len(description.find("ModelStructure/Derivatives")) == 14
    for derivative in derivatives:
        state = scalars[int(derivative[0].get("derivative")) - 1]
        assert derivative.get("name") == f"der({state.get('name')})"


def test_outputs_do_not_depend_on_inputs_at_the_same_instant(envisat_fmu, description, tmp_path):
    assert not {known for _, known in _declared(description, "Outputs")} & set(range(6))
    importer = Importer(envisat_fmu, tmp_path)
    importer.initialise()
    outputs = [
        reference for name, reference in importer.references.items() if name.startswith(("features", "target.p"))
    ]
    before = importer.fmu.getReal(outputs)
    importer.fmu.setReal(list(range(6)), [1.0] * 6)
    assert importer.fmu.getReal(outputs) == before
    importer.fmu.freeInstance()


def test_two_builds_are_equal_and_without_a_compiler_warning(envisat, tmp_path, monkeypatch):
    monkeypatch.delenv("CFLAGS")  # as users build
    built = []
    for folder in ("one", "an/other"):
        monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / folder / "cache"))  # or it would be compiled once
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            built.append(build_fmu(envisat, tmp_path / folder / "unit.fmu").read_bytes())
    assert built[0] == built[1]


def test_units_of_different_scenarios_have_different_tokens(envisat):
    run = envisat.run.model_copy(update={"tolerance": 1e-10})
    scenarios = (envisat, envisat, envisat.model_copy(update={"run": run}))
    tokens = [ET.fromstring(describe_unit(target_blueprint(scenario), 2)[0]).get("guid") for scenario in scenarios]  # noqa: S314  our own
    assert tokens[0] == tokens[1] != tokens[2]


@pytest.mark.parametrize("fmi, output", [(2, "target.position[2]"), (3, "target.position")])
def test_an_importer_can_compile_the_sources(fmi, output, envisat_fmu, envisat_fmu3, tmp_path, monkeypatch):
    """As `fmpy compile` does, by CMake; its numbers are the shipped library's to the last digits of other flags.

    Those of a release for FMI 3, as usual. For FMI 2, which test_platforms.py optimises and runs, those that compile
    soonest.
    """
    here = Path(sys.executable).parent
    monkeypatch.setenv("PATH", f"{here}{os.pathsep}{os.environ['PATH']}")  # fmpy brings cmake
    if shutil.which("cc") is None or shutil.which("c++") is None:  # fmpy's project asks for both
        monkeypatch.setenv("CC", f"{here / 'python-zig'} cc")
        monkeypatch.setenv("CXX", f"{here / 'python-zig'} c++")
    shipped, folder = (envisat_fmu3 if fmi == 3 else envisat_fmu), tmp_path / "unit"
    fmpy.extract(str(shipped), str(folder))
    shutil.rmtree(folder / "binaries")
    (tmp_path / "cmake").mkdir()
    options = {"CMAKE_COMPILE_WARNING_AS_ERROR:BOOL": "ON"}
    kind = "Debug" if fmi == 2 else "Release"
    build_platform_binary(folder, tmp_path / "cmake", configuration=kind, cmake_options=options)
    assert [path.stem for path in (folder / "binaries").rglob("*.*")] == ["TumblingTarget"]

    own, theirs = (
        fmpy.simulate_fmu(str(unit), stop_time=100.0, output_interval=10.0, output=[output])[output]
        for unit in (shipped, folder)
    )
    assert len(own) == 11
    np.testing.assert_allclose(theirs, own, rtol=1e-10, atol=1e-10)


def test_sources_come_with_every_file_they_include_and_with_licences(envisat_fmu):
    with zipfile.ZipFile(envisat_fmu) as archive:
        sources = {name.removeprefix("sources/") for name in archive.namelist() if name.startswith("sources/")}
        text = b"".join(archive.read(f"sources/{name}") for name in sources).decode()
        own = archive.read("documentation/licenses/license.txt").decode()
        headers = archive.read("documentation/licenses/fmi2Functions.h.txt").decode()
    assert {"all.c", "model.c", "tables.h", "dop853.h"} <= sources
    included = {
        name for name in re.findall(r'^#include "(.*)"', text, re.MULTILINE) if not re.match(r"fmi3|fmi2\w+.h", name)
    }
    assert included <= sources
    assert own == (Path(__file__).parents[3] / "LICENSE").read_text(encoding="utf-8")
    assert headers.startswith("Copyright")
    assert "Redistributions in binary form must reproduce" in headers


def test_fmpy_reads_the_build_description(tmp_path):
    """Against the standard's schema, which fmpy holds."""
    (tmp_path / "sources").mkdir()
    (tmp_path / "sources" / "buildDescription.xml").write_bytes(build_description("Model"))
    [configuration] = read_build_description(str(tmp_path), validate=True)
    assert configuration.modelIdentifier == "Model"
    [files] = configuration.sourceFileSets
    assert (files.language, files.sourceFiles) == ("C11", ["all.c"])


def test_zig_builds_the_same_unit(envisat, envisat_fmu, tmp_path, monkeypatch):
    """On a machine without a compiler of its own; the numbers agree to the last digits of libm."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("baryscope.fmu.generate.compiler.CANDIDATES", ())
    assert find_compiler() == [sys.executable, "-m", "ziglang", "cc"]
    unit = build_fmu(envisat, tmp_path / "zig.fmu")
    assert validate_fmu(str(unit)) == []
    with Session(unit) as zig, Session(envisat_fmu) as native:
        for session in (zig, native):
            session.step(100.0)
        np.testing.assert_allclose(zig.outputs, native.outputs, rtol=1e-10, atol=1e-10)


def test_a_machine_without_any_compiler_is_told_what_to_do(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("baryscope.fmu.generate.compiler.CANDIDATES", ())
    monkeypatch.setattr("baryscope.fmu.generate.compiler.find_spec", lambda name: None)
    with pytest.raises(ComputationError, match=r"no C compiler found.*baryscope\[cross\]"):
        find_compiler()


def test_a_compiler_of_the_readers_own_is_found_from_any_folder(tmp_path, monkeypatch):
    """Compilers run in a folder of their own, where a relative path would lead nowhere."""
    (tmp_path / "mine").write_text("#!/bin/sh\n")
    (tmp_path / "mine").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", "./mine -m64")
    assert find_compiler() == [str(tmp_path / "mine"), "-m64"]


def test_a_compiler_that_fails_leaves_the_old_file(envisat, tmp_path, monkeypatch):
    old = tmp_path / "unit.fmu"
    old.write_text("old")
    monkeypatch.setenv("CC", shlex.join([sys.executable, "-c", "raise SystemExit(1)"]))
    with pytest.raises(ComputationError, match="failed"):
        build_fmu(envisat, old)
    assert old.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["unit.fmu"]


def test_an_unknown_compiler_is_named(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler -O1")
    with pytest.raises(ComputationError, match="'no-such-compiler'"):
        find_compiler()


@pytest.mark.parametrize("variable", ["CC", "CFLAGS"])
def test_a_variable_that_cannot_be_parted_into_words_is_named(envisat, tmp_path, monkeypatch, variable):
    monkeypatch.setenv(variable, "cc '-O1")
    with pytest.raises(ComputationError, match=rf"the variable {variable} is \"cc '-O1\": No closing quotation"):
        build_fmu(envisat, tmp_path / "unit.fmu")


def test_a_folder_is_no_file_to_write(envisat, tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        build_fmu(envisat, tmp_path)
