"""What a library is compiled by: what its key depends on, and what is said when it fails."""

import shutil

import fmpy
import pytest

from baryscope.fmu.generate import compiler
from baryscope.fmu.generate.compiler import Job, compile_all, find_cross_compiler
from baryscope.fmu.layout.platforms import AARCH64_DARWIN, AARCH64_LINUX, X86_64_LINUX, X86_64_WINDOWS, host_platform
from baryscope.models.errors import ComputationError


def job(platform=X86_64_LINUX, source=b"int f(void) { return 1; }\n", command=None, **others):
    compiler_command = tuple(command or find_cross_compiler())
    return Job({"a.c": source} | others, "a.c", f"a{platform.suffix}", platform, compiler_command)


def test_the_key_depends_on_everything_the_library_is_made_from(monkeypatch):
    base = job()
    assert base.key() is not None
    assert base.key() == job().key()
    others = [
        job(AARCH64_LINUX),
        job(source=b"int f(void) { return 2; }\n"),
        job(b=b"int f(void) { return 1; }\n"),
        job(command=["cc"]) if shutil.which("cc") else job(AARCH64_DARWIN),
    ]
    monkeypatch.setattr(compiler, "FLAGS", ("-O0",))
    others.append(job())
    keys = [other.key() for other in others]
    monkeypatch.undo()
    monkeypatch.setattr(compiler, "version", lambda package: "0.0.1")
    keys.append(job().key())
    monkeypatch.undo()
    keys.append(base.key())
    monkeypatch.setenv("CPATH", "/elsewhere")
    keys.append(job().key())
    monkeypatch.setenv("CFLAGS", "-O1")
    keys.append(job(command=["cc"] if shutil.which("cc") else None).key())
    assert len(set(keys)) == len(keys)


def test_libraries_of_an_unknown_compiler_are_not_cached():
    assert job(command=["false"]).key() is None
    assert job(command=["/no/such/compiler"]).key() is None


def test_a_compiler_that_cannot_be_run_is_named():
    with pytest.raises(ComputationError, match=r"/no/such/compiler.*cannot be run"):
        compile_all([job(command=["/no/such/compiler"])])


def test_a_cache_that_cannot_be_written_is_ignored(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("BARYSCOPE_CACHE", str(tmp_path / "file"))
    first, second = (compile_all([job()])[X86_64_LINUX] for _ in range(2))
    assert first.startswith(b"\x7fELF")
    assert second == first


def test_an_error_in_the_source_names_platform_and_place():
    with pytest.raises(ComputationError, match=r"x86_64-windows: a\.c:1:1: error"):
        compile_all([job(X86_64_WINDOWS, b"nonsense;\n")])


def test_compiler_warnings_are_repeated_by_every_build():
    source = b"int f(void) { int unused; return 1; }\n"
    for _ in range(2):
        with pytest.warns(UserWarning, match="unused"):
            compile_all([job(source=source)])


def test_a_machine_outside_the_table_builds_for_itself(monkeypatch):
    monkeypatch.setattr("baryscope.fmu.layout.platforms.libc_ver", lambda: ("", ""))  # musl
    if fmpy.system == "linux":
        assert host_platform().target == ""
    monkeypatch.setattr(fmpy, "platform_tuple", "aarch64-windows")
    monkeypatch.setattr(fmpy, "platform", "win64")
    monkeypatch.setattr(fmpy, "system", "windows")
    host = host_platform()
    assert (host.folders(2), host.folders(3), host.target) == (("win64",), ("aarch64-windows",), "")
    assert "-mcpu=baseline" in job(host).steps[0]
