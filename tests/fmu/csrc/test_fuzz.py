"""Random legal and illegal calls: a C harness under sanitizers, and a stateful test from Python."""

import os
import re
import shutil
import subprocess

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from hypothesis import settings
from hypothesis.stateful import run_state_machine_as_test

from baryscope.fmu.generate.build import describe_unit
from baryscope.fmu.generate.sources import interface_headers
from baryscope.fmu.units import UNITS, blueprint_of
from baryscope.fmu.units.target import target_blueprint
from fuzz_machine import Machine
from importer import Importer

CALLS = 60_000
SAMPLED_CALLS = {"rig": 30_000, "estimator": 15_000, "controller": 30_000}  # those of the filter take longest
# What is undefined traps: so it takes half as long to compile, and AddressSanitizer says in which line that was.
SANITIZERS = (
    "-fsanitize=address,undefined",
    "-fsanitize-undefined-trap-on-error",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
)


@pytest.fixture(scope="module")
def sanitizing_compiler(tmp_path_factory):
    """A compiler whose sanitizers run here and find an artificial leak."""
    folder = tmp_path_factory.mktemp("sanitizers")
    (folder / "leak.c").write_text("#include <stdlib.h>\nint main(void) { return malloc(9) == (void *)1; }\n")
    for name in ("gcc", "clang", "cc"):
        compiler = shutil.which(name)
        if compiler is None:
            continue
        command = [compiler, *SANITIZERS, "-O0", "leak.c", "-o", "leak"]
        if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 0:
            run = subprocess.run([folder / "leak"], capture_output=True, text=True, check=False)
            if "detected memory leaks" in run.stderr:
                return compiler
    pytest.skip("no compiler here has AddressSanitizer with leak detection, UndefinedBehaviorSanitizer and a libc")


def fuzzed(folder, calls):
    """The harness in a folder carried out for so many calls."""
    environment = os.environ | {"ASAN_OPTIONS": "handle_sigill=1"}  # else a trap ends it without a word
    command = [folder / "fuzz", str(calls), "7"]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


@pytest.mark.parametrize("fmi, scalar", [(2, True), (3, False), (3, True)])
def test_random_calls_in_c(sanitizing_compiler, small, tmp_path, fmi, scalar, request):
    """The harness has its own model of what is legal; see fuzz_harness.c."""
    _, sources = describe_unit(target_blueprint(small), fmi, scalar=scalar)
    for name, content in (sources | interface_headers(fmi)).items():
        (tmp_path / name).write_bytes(content)
    here = request.path.parent
    # 2000 internal steps suffice for sensible inputs; others fail at once instead of after a minute.
    flags = ["-std=c11", "-g", "-O0", "-w", "-DMOST_STEPS=2000L", *SANITIZERS, f"-I{tmp_path}", f"-I{here}"]
    command = [sanitizing_compiler, *flags, str(here / "fuzz_harness.c"), "-o", "fuzz", "-lm"]
    compiled = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stderr
    result = fuzzed(tmp_path, CALLS)
    assert result.returncode == 0, result.stderr
    calls, refused, messages, failed = map(int, re.findall(r"\d+", result.stdout))
    assert calls >= CALLS
    assert calls > refused > calls // 4  # both kinds of calls are plenty
    assert messages > 0
    assert failed > 0


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "target"])
def test_random_calls_on_sampled_units(sanitizing_compiler, small, tmp_path, unit, request):
    _, sources = describe_unit(blueprint_of(unit, small), 2)
    for name, content in (sources | interface_headers(2)).items():
        (tmp_path / name).write_bytes(content)
    harness = str(request.path.with_name("fuzz_sampled.c"))
    command = [sanitizing_compiler, "-std=c11", "-g", "-O0", "-w", *SANITIZERS, f"-I{tmp_path}", harness]
    compiled = subprocess.run(
        [*command, "-o", "fuzz", "-lm"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert compiled.returncode == 0, compiled.stderr
    most = SAMPLED_CALLS[unit]
    result = fuzzed(tmp_path, most)
    assert result.returncode == 0, result.stderr
    calls, refused, lives = map(int, re.findall(r"\d+", result.stdout))
    assert calls > refused > calls // 20
    assert lives > most // 1500


# ---- from Python ----


@pytest.mark.parametrize("interface", [0, 1], ids=["ModelExchange", "CoSimulation"])
def test_random_calls_from_python(envisat_fmu, tmp_path, interface):
    description = fmpy.read_model_description(str(envisat_fmu))
    fmpy.extract(str(envisat_fmu), str(tmp_path))
    library = FMU2Slave(
        guid=description.guid, modelIdentifier=description.modelName, unzipDirectory=str(tmp_path), instanceName="fuzz"
    )
    attributes = {"library": library, "description": description, "interface": interface}
    machine = type("UnitMachine", (Machine,), attributes)
    run_state_machine_as_test(machine, settings=settings(max_examples=50, stateful_step_count=80, deadline=None))
    library.freeLibrary()


# ---- what the fuzzers found ----


def test_a_refused_list_of_booleans_sets_none(envisat_fmu, tmp_path):
    importer = Importer(envisat_fmu, tmp_path)
    s, flag = importer.fmu, importer.references["gravityGradient"]
    importer.refused(lambda: s.setBoolean([flag, 9999], [True, True]), "9999")
    importer.initialise()
    assert s.getBoolean([flag]) == [0]
    s.freeInstance()


def test_a_refused_tuning_sets_no_input_either(envisat_fmu, tmp_path):
    importer = Importer(envisat_fmu, tmp_path)
    s, torque, tolerance = (
        importer.fmu,
        importer.references["target.torque[1]"],
        importer.references["solver.tolerance"],
    )
    importer.initialise()
    importer.refused(lambda: s.setReal([torque, tolerance], [5.0, 0.0]), "solver.tolerance")
    assert s.getReal([torque]) == [0.0]
    s.freeInstance()
