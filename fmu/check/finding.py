"""The findings of the checks, and their severities."""

from dataclasses import dataclass
from enum import StrEnum

LISTED = 3  # names in a message


class Severity(StrEnum):
    """An error violates the FMI standard or the unit's own declarations; a warning may be intended."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """One violation or doubt.

    Attributes:
        severity: error or warning.
        subject: the variable, unit or attribute it is about.
        message: what was found and what was expected.
    """

    severity: Severity
    subject: str
    message: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.subject}: {' '.join(self.message.split())}"


def error(subject: str, message: str) -> Finding:
    """A finding that violates the standard or a declaration."""
    return Finding(Severity.ERROR, subject, message)


def warning(subject: str, message: str) -> Finding:
    """A finding that may be intended."""
    return Finding(Severity.WARNING, subject, message)


def listed(names: list[str]) -> str:
    """The first names, and the number of the others."""
    rest = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {rest} more" if rest > 0 else "")
