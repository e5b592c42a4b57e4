"""What the checker of FMUs says: findings, and where their severities come from."""

from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """An error breaks the FMI standard or what the unit declares; a warning may be meant."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it should be.

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
    """A finding that breaks the standard or what is declared."""
    return Finding(Severity.ERROR, subject, message)


def warning(subject: str, message: str) -> Finding:
    """A finding that may be meant."""
    return Finding(Severity.WARNING, subject, message)


def listed(names: list[str], most: int = 3) -> str:
    """Some names, and how many more there are."""
    rest = len(names) - most
    return ", ".join(names[:most]) + (f" and {rest} more" if rest > 0 else "")
