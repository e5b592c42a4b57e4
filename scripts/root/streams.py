"""Standard streams as a command finds them, made fit for whatever it prints."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from typing import TextIO


def prepare_streams() -> None:
    """Make standard output and standard error fit to be printed to.

    One that is closed is replaced: standard output by one that cannot be written, which is told as of a full disk, and
    standard error by one that drops everything. What the encoding of standard output lacks is replaced, as standard
    error does, where it would be an error. A width of 0 columns is taken for none told, as by Python.
    """
    if os.environ.get("COLUMNS", "").strip("0") == "":
        os.environ.pop("COLUMNS", None)
    if sys.stdout is None:
        sys.stdout = _in_place(1, os.O_RDONLY)
    if sys.stderr is None:
        sys.stderr = _in_place(2, os.O_WRONLY)
    out = sys.stdout
    if not isinstance(out, TextIOWrapper):
        return
    if out.errors == "strict" or (out.errors == "surrogateescape" and not speaks_unicode(out.encoding)):
        out.reconfigure(errors="replace")


def speaks_unicode(encoding: str) -> bool:
    """Whether an encoding has every character."""
    return encoding.lower().startswith("utf")


def _in_place(number: int, mode: int) -> TextIO:
    """The null device in the place of a closed stream, so that no file gets its number and what is printed there."""
    handle = os.open(os.devnull, mode)
    if handle != number and not _is_open(number):
        os.dup2(handle, number)
        os.close(handle)
        handle = number
    return os.fdopen(handle, "w", encoding="utf-8", errors="replace")


def _is_open(number: int) -> bool:
    with suppress(OSError):
        os.fstat(number)
        return True
    return False


def drop_output() -> None:
    """What is still to be printed goes nowhere: as where its reader has gone."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
