"""The C of the online estimator as one file."""

import pytest

from baryscope.estimator.online.core import MAIN, sources
from compiling import compiled

QUIET = b"""#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
%s
#pragma GCC diagnostic pop
"""


def test_no_function_of_it_is_left_unused(tmp_path):
    """One that was to go on from what is known, in blackouts, was never called: claims were far too small.

    With -flto the compiler tells, and leaves machine code for later.
    """
    for name, text in sources().items():
        (tmp_path / name).write_bytes(QUIET % text if name == "dynamics.c" else text)
    compiled(tmp_path, "-Wunused-function", "-flto", "-c", MAIN, "-o", "online.o")


def test_fast_math_is_refused(tmp_path):
    """With -ffast-math among the user's CFLAGS a point of NaN was taken."""
    for name, text in sources().items():
        (tmp_path / name).write_bytes(text)
    with pytest.raises(AssertionError, match="-ffast-math and -ffinite-math-only take away the checks"):
        compiled(tmp_path, "-ffast-math", "-c", MAIN, "-o", "online.o")
