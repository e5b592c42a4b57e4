"""All platforms from one machine: the right files, equal bytes, and libraries that run where they are meant to."""

import os
import re
import shutil
import struct
import subprocess
import tempfile
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import baryscope.fmu
import forces
from baryscope.fmu import Session, build_fmu
from baryscope.fmu.generate import compiler
from baryscope.fmu.generate.compiler import FLAGS, Job, find_cross_compiler
from baryscope.fmu.layout.platforms import (
    AARCH64_LINUX,
    PLATFORMS,
    X86_64_DARWIN,
    X86_64_LINUX,
    X86_64_WINDOWS,
    host_platform,
    library_of_this_machine,
)
from baryscope.models.errors import ComputationError
from baryscope.scripts.cli.build import build

STEPS, STEP = 600, 0.1  # s
AGREEMENT = 1e-9  # relative: each platform has its own sine and cosine
WINE = Path("/usr/lib/wine/wine64")  # where Debian has it, out of the PATH
WINDOWS = Path("/usr/lib/x86_64-linux-gnu/wine/x86_64-windows")  # and the libraries of its Windows
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")


@pytest.fixture(scope="module", autouse=True)
def macs_sooner():
    """Libraries for Macs, of which only the form is tested, are made without optimisation, also where users' are."""
    as_told = Job.steps.fget

    def steps(job):
        told = as_told(job)
        if "darwin" not in job.platform.name or any("-Xclang" in step for step in told):
            return told
        return [
            [new for word in step for new in ((word, "-Xclang", "-O0") if word == "-O3" else (word,))] for step in told
        ]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Job, "steps", property(steps))
        yield


@pytest.fixture(scope="module")
def everywhere(envisat, tmp_path_factory):
    """The unit for all platforms, as users build it, but for those of Macs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("CFLAGS")
        return build_fmu(envisat, tmp_path_factory.mktemp("everywhere") / "unit.fmu", platforms="all")


@pytest.fixture(scope="module")
def unpacked(everywhere, tmp_path_factory):
    folder = tmp_path_factory.mktemp("unpacked")
    fmpy.extract(str(everywhere), str(folder))
    return folder


@pytest.fixture(scope="module")
def everywhere3(envisat, tmp_path_factory):
    """The same of FMI 3, with arrays, not optimised."""
    return build_fmu(envisat, tmp_path_factory.mktemp("everywhere3") / "unit.fmu", fmi=3, platforms="all")


@pytest.fixture(scope="module")
def unpacked3(everywhere3, tmp_path_factory):
    folder = tmp_path_factory.mktemp("unpacked3")
    fmpy.extract(str(everywhere3), str(folder))
    return folder


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def unpacked_of_each(request, unpacked, unpacked3):
    return unpacked if request.param == 2 else unpacked3


@pytest.fixture(scope="module")
def expected(envisat_fmu):
    """The outputs of the library that this machine's own compiler made."""
    with Session(envisat_fmu) as session:
        for _ in range(STEPS):
            session.step(STEP)
        return session.outputs.copy()


def compile_driver(platform, fmi, program):
    """By zig, for FMI's version, with what a unit is linked with."""
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).with_name("unit_driver.c")
    zig = [*find_cross_compiler(), "-target", platform.target, "-s", *FLAGS]
    compiling = [*zig, f"-I{headers}", f"-DVERSION={fmi}", str(source)]
    if platform.runtime:
        runtime = Path(baryscope.fmu.__file__).parent / "csrc" / platform.runtime
        subprocess.run([*compiling, "-c", "-o", f"{program}.o"], check=True)
        linked = [f"{program}.o", str(runtime), "-nostdlib", "-lucrtbase", "-lkernel32", "-Wl,-e,windows_start"]
        subprocess.run([*zig, *linked, "-o", str(program)], check=True)
    else:
        subprocess.run([*compiling, "-o", str(program), "-ldl"], check=True)


def drive(unpacked, platform, folder, command, **options):
    """Compile the driver for a platform, run it on the platform's library and return the outputs it prints."""
    program = folder / ("driver.exe" if platform.suffix == ".dll" else "driver")
    description = fmpy.read_model_description(str(unpacked))
    fmi = int(description.fmiVersion[0])
    compile_driver(platform, fmi, program)
    library = unpacked / "binaries" / platform.folders(fmi)[0] / f"TumblingTarget{platform.suffix}"
    outputs = [v for v in description.modelVariables if v.causality == "output"]
    references, size = [v.valueReference for v in outputs], sum(int(np.prod(v.shape or 1)) for v in outputs)
    assert references == list(range(references[0], references[-1] + 1))
    numbers = [str(value) for value in (STEPS, STEP, references[0], len(references), size)]
    token = description.guid if fmi == 2 else description.instantiationToken
    result = subprocess.run(
        [*command, str(program), str(library), token, *numbers],
        capture_output=True,
        text=True,
        check=False,
        **options,
    )
    assert result.returncode == 0, result.stderr
    return np.array(result.stdout.split(), dtype=float)


@pytest.fixture(scope="module")
def wine():
    """The command, and an environment with a folder of Windows of its own.

    Where the libraries are known, that has them and nothing else: to set up a whole Windows takes wine seven seconds.
    """
    command = str(WINE) if WINE.exists() else shutil.which("wine64") or shutil.which("wine")
    if command is None:
        pytest.skip("needs the package wine64")
    prefix = tempfile.mkdtemp(prefix="wine-")  # short: the server's socket path depends on it
    left_out = "mscoree=;mshtml="
    if WINE.exists() and WINDOWS.exists():
        system = Path(prefix) / "drive_c" / "windows" / "system32"
        system.mkdir(parents=True)
        for library in WINDOWS.iterdir():
            (system / library.name).symlink_to(library)
        left_out += ";wineboot.exe="
    environment = os.environ | {"WINEPREFIX": prefix, "WINEDEBUG": "-all", "WINEDLLOVERRIDES": left_out}
    environment.pop("DISPLAY", None)
    server = WINE.with_name("wineserver64")
    if server.exists():
        environment["WINESERVER"] = str(server)
    try:
        yield command, environment
    finally:
        if server.exists():  # ends the server of this prefix alone
            subprocess.run([str(server), "-k"], env=environment, check=False)
        shutil.rmtree(prefix, ignore_errors=True)


def test_the_windows_library_runs_under_wine(unpacked_of_each, wine, expected, tmp_path):
    command, environment = wine
    found = drive(unpacked_of_each, X86_64_WINDOWS, tmp_path, [command], env=environment)
    np.testing.assert_allclose(found, expected, rtol=AGREEMENT, atol=AGREEMENT)


def test_the_aarch64_library_runs_under_qemu(unpacked_of_each, expected, tmp_path):
    qemu = shutil.which("qemu-aarch64-static") or shutil.which("qemu-aarch64")
    if qemu is None:
        pytest.skip("needs the package qemu-user-static")
    if not (ARM_LIBRARIES / "lib" / "ld-linux-aarch64.so.1").exists():
        pytest.skip("needs the package libc6-arm64-cross")
    found = drive(unpacked_of_each, AARCH64_LINUX, tmp_path, [qemu, "-L", str(ARM_LIBRARIES)])
    np.testing.assert_allclose(found, expected, rtol=AGREEMENT, atol=AGREEMENT)


def test_fmpy_accepts_it_and_the_library_for_this_machine_runs(everywhere, unpacked, expected):
    assert validate_fmu(str(everywhere)) == []
    library = library_of_this_machine(unpacked, "TumblingTarget", 2)
    assert library == unpacked / "binaries" / host_platform().fmi2_folder / f"TumblingTarget{host_platform().suffix}"
    with Session(everywhere) as session:
        for _ in range(STEPS):
            session.step(STEP)
        np.testing.assert_allclose(session.outputs, expected, rtol=AGREEMENT, atol=AGREEMENT)


def test_in_fmi_3_every_library_is_in_the_folder_of_its_tuple(everywhere3, envisat_fmu3):
    assert validate_fmu(str(everywhere3)) == []
    with zipfile.ZipFile(everywhere3) as archive:
        binaries = {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}
    assert len(binaries) == len(PLATFORMS)
    for platform in PLATFORMS:
        content = binaries[f"binaries/{platform.name}/TumblingTarget{platform.suffix}"]
        assert machine(content) == tuple(reversed(platform.name.split("-")))
    result = fmpy.simulate_fmu(str(everywhere3), stop_time=10.0, output_interval=10.0, output=["target.position"])
    expected = fmpy.simulate_fmu(str(envisat_fmu3), stop_time=10.0, output_interval=10.0, output=["target.position"])
    np.testing.assert_allclose(result["target.position"], expected["target.position"], rtol=AGREEMENT)


def machine(content):
    """System and processor from a library's header (elf.h, winnt.h, mach-o/loader.h)."""
    if content[:4] == b"\x7fELF":
        return "linux", {62: "x86_64", 183: "aarch64"}[struct.unpack_from("<H", content, 18)[0]]
    if content[:2] == b"MZ":
        begin = struct.unpack_from("<I", content, 60)[0]
        assert content[begin : begin + 4] == b"PE\0\0"
        return "windows", {0x8664: "x86_64"}[struct.unpack_from("<H", content, begin + 4)[0]]
    magic, processor, _, kind = struct.unpack_from("<IIII", content)
    assert (magic, kind) == (0xFEEDFACF, 6)  # 64 bits, a dynamic library
    return "darwin", {0x01000007: "x86_64", 0x0100000C: "aarch64"}[processor]


def test_every_library_is_in_its_folder(unpacked):
    found = {path.parent.name: path for path in (unpacked / "binaries").rglob("TumblingTarget.*")}
    assert set(found) == {"linux64", "aarch64-linux", "win64", "darwin64", "aarch64-darwin"}
    for platform in set(PLATFORMS) - {X86_64_DARWIN}:
        path = found[platform.fmi2_folder]
        assert path.suffix == platform.suffix
        assert machine(path.read_bytes()) == tuple(reversed(platform.name.split("-")))


def test_macs_of_both_kinds_find_theirs_in_darwin64(unpacked):
    content = (unpacked / "binaries" / "darwin64" / "TumblingTarget.dylib").read_bytes()
    assert struct.unpack_from(">II", content) == (0xCAFEBABE, 2)
    slices = {}
    for place in (8, 28):
        processor, _, begin, size, power = struct.unpack_from(">IIIII", content, place)
        assert begin % (1 << power) == 0
        slices[processor] = content[begin : begin + size]
        assert struct.unpack_from("<I", slices[processor], 4) == (processor,)
        assert machine(slices[processor])[0] == "darwin"
    arm = (unpacked / "binaries" / "aarch64-darwin" / "TumblingTarget.dylib").read_bytes()
    assert slices[0x0100000C] == arm
    assert set(slices) == {0x01000007, 0x0100000C}


def glibc_asked_for(library):
    """The latest version of glibc that a library needs."""
    versions = {tuple(map(int, found)) for found in re.findall(rb"GLIBC_(\d+)\.(\d+)", library)}
    assert versions
    return max(versions)


def test_linux_libraries_ask_for_no_more_than_glibc_2_17(unpacked):
    for platform in (X86_64_LINUX, AARCH64_LINUX):
        content = (unpacked / "binaries" / platform.fmi2_folder / "TumblingTarget.so").read_bytes()
        assert glibc_asked_for(content) <= (2, 17)


@pytest.mark.skipif(host_platform() not in (X86_64_LINUX, AARCH64_LINUX), reason="needs Linux with glibc")
def test_the_systems_compiler_asks_for_no_more_either(envisat_fmu):
    """Not for the pow of the machine, which glibc 2.29 renewed; forces need its exp."""
    with zipfile.ZipFile(envisat_fmu) as archive:
        content = archive.read(f"binaries/{host_platform().fmi2_folder}/TumblingTarget.so")
    assert glibc_asked_for(content) <= (2, 17)


def test_linux_alone(envisat, everywhere, tmp_path, monkeypatch):
    monkeypatch.delenv("CFLAGS")
    unit = build_fmu(envisat, tmp_path / "linux.fmu", platforms="linux")
    with zipfile.ZipFile(unit) as new, zipfile.ZipFile(everywhere) as whole:
        binaries = [name for name in new.namelist() if name.startswith("binaries/")]
        assert sorted(binaries) == [f"binaries/{folder}/TumblingTarget.so" for folder in ("aarch64-linux", "linux64")]
        assert all(new.read(name) == whole.read(name) for name in binaries)


def test_drag_needs_exp_and_linux_has_it_for_glibc_2_17(small, tmp_path):
    unit = build_fmu(small.model_copy(update={"drag": forces.DRAG}), tmp_path / "drag.fmu", platforms="linux")
    with zipfile.ZipFile(unit) as archive:
        libraries = [archive.read(name) for name in archive.namelist() if name.endswith(".so")]
    assert len(libraries) == 2
    assert all(b"\0exp\0" in library and glibc_asked_for(library) <= (2, 17) for library in libraries)


def test_a_build_in_another_folder_is_equal(envisat, everywhere3, tmp_path, monkeypatch):
    folder = tmp_path / "a temporary folder with another and longer name"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "empty"))
    monkeypatch.chdir(folder)
    again = build_fmu(envisat, tmp_path / "again.fmu", fmi=3, platforms="all")
    with zipfile.ZipFile(again) as new, zipfile.ZipFile(everywhere3) as old:
        assert [name for name in new.namelist() if new.read(name) != old.read(name)] == []
    assert again.read_bytes() == everywhere3.read_bytes()


def test_a_second_build_compiles_nothing(envisat, everywhere, tmp_path, monkeypatch):
    def compiled(job, _):
        raise AssertionError(f"compiled for {job.platform.name}")

    monkeypatch.setattr(compiler, "_compile", compiled)
    monkeypatch.delenv("CFLAGS")
    told = []
    again = build_fmu(envisat, tmp_path / "again.fmu", platforms="all", progress=lambda *news: told.append(news))
    assert again.read_bytes() == everywhere.read_bytes()
    assert told == []


def test_the_command_line_says_what_it_waits_for(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "empty"))
    monkeypatch.setattr(compiler, "_compile", lambda job, _: (job.platform.name.encode(), ""))
    waits = []
    for _ in range(2):
        build(scenario="envisat", platforms="all", output=tmp_path / "unit.fmu")
        shown = capsys.readouterr()
        assert "unit.fmu: 12 features" in shown.out
        waits.append([line for line in shown.err.splitlines() if line.startswith("compiling for ")])
    assert [len(lines) for lines in waits] == [5, 0]  # the second build takes all from the cache
    assert waits[0][0] == f"compiling for {', '.join(platform.name for platform in PLATFORMS)}"
    with zipfile.ZipFile(tmp_path / "unit.fmu") as archive:
        assert archive.read("binaries/win64/TumblingTarget.dll") == b"x86_64-windows"


def test_progress_names_what_is_left(envisat, tmp_path, monkeypatch):
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "empty"))
    monkeypatch.setattr(compiler, "_compile", lambda job, _: (job.platform.name.encode(), ""))
    told = []
    build_fmu(envisat, tmp_path / "unit.fmu", platforms="all", progress=lambda *news: told.append(news))
    assert told[0] == (tuple(platform.name for platform in PLATFORMS), 0.0)
    assert told[-1] == ((), 1.0)
    assert [len(left) for left, _ in told] == [5, 4, 3, 2, 1, 0]


def test_the_dll_needs_no_more_than_windows_has(unpacked):
    content = (unpacked / "binaries" / "win64" / "TumblingTarget.dll").read_bytes()
    assert set(re.findall(rb"[\w.-]+\.dll", content)) == {b"ucrtbase.dll", b"TumblingTarget.dll"}


def test_without_zig_one_is_told_what_to_do(envisat, tmp_path, monkeypatch):
    monkeypatch.setattr("baryscope.fmu.generate.compiler.find_spec", lambda name: None)
    with pytest.raises(ComputationError, match=r"ziglang.*pip install 'baryscope\[cross\]'"):
        build_fmu(envisat, tmp_path / "unit.fmu", platforms="all")
    assert list(tmp_path.iterdir()) == []
