"""Finding a C compiler and making a shared library with it: the system's, or zig from PyPI where there is none."""

import os
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from baryscope.models.errors import ComputationError

CANDIDATES = ("cc", "gcc", "clang")
# No -ffast-math: it would drop isfinite. No contraction: the same numbers from every compiler.
FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fvisibility=hidden", "-shared")
WARNINGS = ("-Wall", "-Wextra", "-Wno-unused-function", "-Wno-unused-parameter")


def find_compiler() -> list[str]:
    """The command of a C compiler: $CC, else the system's, else zig's.

    Raises:
        ComputationError: there is none, or $CC names none.
    """
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        if shutil.which(named[0]) is None:
            raise ComputationError(f"C compiler {named[0]!r}, named by the variable CC, was not found")
        return named
    for candidate in CANDIDATES:
        path = shutil.which(candidate)
        if path is not None:
            return [path]
    if find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    raise ComputationError(
        "no C compiler found: install one (cc, gcc or clang), or the one from PyPI: pip install 'baryscope[cross]'"
    )


def compile_library(source: Path, includes: list[Path], library: Path) -> str:
    """Compile one C file to a shared library; returns the compiler's warnings, which should be empty.

    Raises:
        ComputationError: the compiler is missing or fails; the message holds its first error.
    """
    command = [
        *find_compiler(),
        *FLAGS,
        *WARNINGS,
        *([] if sys.platform == "win32" else ["-fPIC"]),
        *(f"-I{folder}" for folder in includes),
        str(source),
        "-o",
        str(library),
        *([] if sys.platform == "win32" else ["-lm"]),
    ]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        lines = result.stderr.splitlines()
        first = next((line for line in lines if "error" in line), lines[-1] if lines else "no message")
        raise ComputationError(f"the C compiler ({shlex.join(command[:3])} …) failed: {first}")
    return result.stderr
