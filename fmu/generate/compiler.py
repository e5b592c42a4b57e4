"""Finds a C compiler and builds shared libraries: the system's compiler, or zig from PyPI for every platform."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from platform import libc_ver

from baryscope.fmu.generate.cache import load_cached, store_cached
from baryscope.fmu.generate.processes import Compilers
from baryscope.fmu.layout.platforms import Platform
from baryscope.models.errors import ComputationError
from baryscope.models.files import temporary_folder

CANDIDATES = ("cc", "gcc", "clang")
# No -ffast-math: it breaks isfinite. No contraction: all compilers give the same numbers.
FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fvisibility=hidden")
# In a shared library FMI's functions have no prefix.
DEFINITIONS = ("-DFMI2_OVERRIDE_FUNCTION_PREFIX=1", "-DFMI3_OVERRIDE_FUNCTION_PREFIX=1")
WARNINGS = ("-Wall", "-Wextra", "-Wno-unused-function", "-Wno-unused-parameter")
_OBJECT = "unit.o"
# Variables that change a compiler's headers, libraries or target.
_ENVIRONMENT = (
    "CPATH",
    "C_INCLUDE_PATH",
    "LIBRARY_PATH",
    "COMPILER_PATH",
    "GCC_EXEC_PREFIX",
    "SDKROOT",
    "MACOSX_DEPLOYMENT_TARGET",
)

Progress = Callable[[tuple[str, ...], float], None]
"""Takes the names of the platforms that are still being compiled for, and the share done, 0 to 1."""


def find_compiler() -> list[str]:
    """The command of a C compiler: $CC, else the system's, else zig's. All but zig's take $CFLAGS, too.

    Raises:
        ComputationError: there is none, or $CC names none or cannot be parted into words.
    """
    named = _words_of("CC")
    if named:
        path = shutil.which(named[0])
        if path is None:
            raise ComputationError(f"C compiler {named[0]!r}, named by the variable CC, was not found")
        return [str(Path(path).absolute()), *named[1:]]
    for candidate in CANDIDATES:
        path = shutil.which(candidate)
        if path is not None:
            return [path]
    if find_spec("ziglang") is not None:
        return _zig()
    raise ComputationError(
        "no C compiler found: install one (cc, gcc or clang), or the one from PyPI: pip install 'baryscope[cross]'"
    )


def find_cross_compiler() -> list[str]:
    """The command of zig's C compiler, which compiles for every platform.

    Raises:
        ComputationError: it is not installed.
    """
    if find_spec("ziglang") is None:
        raise ComputationError(
            "compiling for other platforms needs the package ziglang, which is not installed: "
            "pip install 'baryscope[cross]'"
        )
    return _zig()


def _words_of(variable: str) -> list[str]:
    """The words of an environment variable, as a shell parts them.

    Raises:
        ComputationError: a quotation is not closed.
    """
    text = os.environ.get(variable, "")
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ComputationError(f"the variable {variable} is {text!r}: {error}, expected words of a shell") from error


def _zig() -> list[str]:
    return [sys.executable, "-m", "ziglang", "cc"]


@dataclass(frozen=True, eq=False)
class Job:
    """A library to be compiled.

    Attributes:
        sources: the source files by name, all in one folder.
        main: the one to be compiled; it includes the others.
        output: the library's name.
        platform: the one to compile for.
        compiler: the command, by `find_compiler` or `find_cross_compiler`.
        apart: a source that is compiled by itself, as many libraries differ by it alone; the others are compiled with
            SCENARIO_APART defined, and the result is kept for the next such library. Empty for none.
    """

    sources: Mapping[str, bytes]
    main: str
    output: str
    platform: Platform
    compiler: tuple[str, ...]
    apart: str = ""

    @property
    def by_zig(self) -> bool:
        """Whether the compiler is the one from PyPI."""
        return list(self.compiler) == _zig()

    @property
    def steps(self) -> list[list[str]]:
        """The compiler's arguments, step by step. All paths are relative, so that equal inputs give equal bytes."""
        target: tuple[str, ...]
        if not self.by_zig:
            target = ()
        elif self.platform.target:  # -s: debugging data would hold paths
            target = ("-target", self.platform.target, "-s")
        else:
            target = ("-mcpu=baseline", "-s")
        flags = [flag.format(library=self.output) for flag in self.platform.flags]
        common = [*target, *FLAGS, *WARNINGS, *self.platform.code_flags]
        own = [] if self.by_zig else _words_of("CFLAGS")
        compiling = [*common, *DEFINITIONS, "-I.", self.main]
        if not (self.apart or self._runtime):
            return [[*compiling, *own, "-o", self.output, *flags]]
        # In two steps with a runtime, too, as zig has its C library's headers only where it links that library.
        definitions, others = (["-DSCENARIO_APART"], [self.apart]) if self.apart else ([], [])
        linked = [_OBJECT, *others, *self._runtime, *flags, *self.platform.runtime_flags]
        return [[*compiling, *definitions, *own, "-c", "-o", _OBJECT], [*common, *own, *linked, "-o", self.output]]

    @property
    def files(self) -> dict[str, bytes]:
        """The sources, and what replaces zig's C library."""
        return {**self.sources, **self._runtime}

    @property
    def _runtime(self) -> dict[str, bytes]:
        name = self.platform.runtime if self.by_zig else ""
        return {name: (files("baryscope.fmu") / "csrc" / name).read_bytes()} if name else {}

    def key(self) -> str | None:
        """The hash of everything the library is made from; None if the compiler's version is unknown."""
        return self._hash_of(self.steps, self.files)

    def object_key(self) -> str | None:
        """The hash of everything that all but `apart` is made from; None as for `key`, and where nothing is apart."""
        others = {name: content for name, content in self.sources.items() if name != self.apart}
        return self._hash_of(self.steps[:1], others) if self.apart else None

    def _hash_of(self, steps: list[list[str]], files: Mapping[str, bytes]) -> str | None:
        identity = _identity(self)
        if identity is None:
            return None
        settings = [f"{name}={os.environ.get(name, '')}" for name in _ENVIRONMENT]
        digest = hashlib.sha256(repr((identity, steps, settings)).encode())
        for name, content in sorted(files.items()):
            digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()


def _identity(job: Job) -> str | None:
    """The compiler and its version; None if unknown."""
    if job.by_zig:
        try:
            return f"ziglang {version('ziglang')}"
        except PackageNotFoundError:
            return None
    try:
        result = subprocess.run([*job.compiler, "--version"], capture_output=True, text=True, check=False)
    except OSError:
        return None
    if result.returncode != 0 or not result.stdout.strip():
        return None
    return repr((job.compiler, result.stdout, libc_ver()))


def compile_all(jobs: Iterable[Job], progress: Progress | None = None) -> dict[Platform, bytes]:
    """The libraries of several jobs, from the cache or compiled, as many at once as there are processors.

    Args:
        jobs: one for each platform.
        progress: called before the first and after each compilation; not called when all come from the cache.

    Raises:
        ComputationError: a compiler cannot be run or fails; the message holds its first error.
    """
    keys = {job: job.key() for job in jobs}
    libraries = {job.platform: load_cached(key) or b"" if key else b"" for job, key in keys.items()}
    left = [job for job in keys if not libraries[job.platform]]
    count = len(left)
    if not left:
        return libraries

    def tell() -> None:
        if progress:
            progress(tuple(job.platform.name for job in left), 1 - len(left) / count)

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        compilers = Compilers()
        try:
            works = {pool.submit(_compile, job, compilers): job for job in left}
            tell()
            for work in as_completed(works):
                job, (library, messages) = works[work], work.result()
                key = keys[job]
                if messages:  # not cached, so that the next build warns again
                    warnings.warn(f"the C compiler warns: {messages}", stacklevel=3)
                elif key:
                    store_cached(key, library)
                libraries[job.platform] = library
                left.remove(job)
                tell()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            compilers.end()
            raise
    return libraries


def _compile(job: Job, compilers: Compilers) -> tuple[bytes, str]:
    """The library and the compiler's warnings; there should be none."""
    messages = ""
    with temporary_folder() as folder:
        for member, content in job.files.items():
            (folder / member).write_bytes(content)
        key, steps = job.object_key(), job.steps
        kept = load_cached(key) if key else None
        if kept:
            (folder / _OBJECT).write_bytes(kept)
            steps = steps[1:]
        for arguments in steps:
            messages += _run(job, arguments, folder, compilers)
        if key and not kept and not messages:
            store_cached(key, (folder / _OBJECT).read_bytes())
        return (folder / job.output).read_bytes(), messages


def _run(job: Job, arguments: list[str], folder: Path, compilers: Compilers) -> str:
    """Run the compiler in a folder, where its output must be then; its messages."""
    command = [*job.compiler, *arguments]
    try:
        code, messages = compilers.run(command, folder)
    except OSError as error:
        raise ComputationError(f"the C compiler ({command[0]}) cannot be run: {error.strerror}") from error
    made = folder / arguments[arguments.index("-o") + 1]
    if code != 0 or not made.is_file():
        lines = messages.splitlines()
        first = next((line for line in lines if "error" in line), lines[-1] if lines else "no message")
        raise ComputationError(f"the C compiler ({shlex.join(job.compiler)} …) failed for {job.platform.name}: {first}")
    return messages
