"""Standard output as a command finds it, made fit for whatever it prints."""

import sys
from io import TextIOWrapper


def make_printable() -> None:
    """Have standard output replace what its encoding lacks, as standard error does, where it would be an error."""
    out = sys.stdout
    if not isinstance(out, TextIOWrapper):
        return
    if out.errors == "strict" or (out.errors == "surrogateescape" and not speaks_unicode(out.encoding)):
        out.reconfigure(errors="replace")


def speaks_unicode(encoding: str) -> bool:
    """Whether an encoding has every character."""
    return encoding.lower().startswith("utf")
