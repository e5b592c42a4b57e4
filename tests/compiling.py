"""C of the units, compiled by the compiler that they are built with."""

import ctypes
import subprocess

from baryscope.estimator.online.core import sources
from baryscope.fmu.generate.compiler import WARNINGS, find_compiler


def compiled(folder, *arguments):
    """Run the compiler in the folder; warnings are errors, unless arguments undo that. Its messages."""
    result = subprocess.run(
        [*find_compiler(), "-std=c11", *WARNINGS, "-Werror", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stderr


def library_of(folder, code, *arguments):
    """The functions of a text of C, as a shared library in the folder."""
    (folder / "code.c").write_text(code)
    compiled(folder, "-fPIC", "-shared", *arguments, "code.c", "-o", "code.so", "-lm")
    return ctypes.CDLL(str(folder / "code.so"))


# What is not called is left out by the optimiser, which takes less time than to compile all of it at -O0.
ONLY_WHAT_IS_CALLED = ("-O1", "-DONLINE_EXPORT=static")


def online_core_of(folder, code, *arguments):
    """The functions of a text of C that includes library.c, the online estimator, as a shared library in the folder."""
    for name, content in sources().items():
        (folder / name).write_bytes(content)
    return library_of(folder, code, *arguments)
