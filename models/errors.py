"""The kinds of failure; the command line ends with exit code 2 for the first and 1 for the others."""

from enum import StrEnum


class InputError(ValueError):
    """An input is wrong. The message is one line: where, what was found, what was expected."""


class Reason(StrEnum):
    """Why a result cannot be computed, for callers that tell the cases apart."""

    TOO_FEW_FEATURES = "too few features"
    COLLINEAR_FEATURES = "features in a line"
    TOO_FEW_FRAMES = "too few frames"
    SHORT_INTERVALS = "features are followed for too short a time"
    TOO_LITTLE_ROTATION = "too little rotation"
    PURE_SPIN = "pure spin"
    DEGENERATE_SCREWS = "no screw can be told"
    DIVERGED = "diverged"
    TOO_LONG = "too long"
    TOO_LARGE = "too many features or frames"
    OPEN_ORBIT = "open orbit"
    NO_NOISE = "no noise"
    OTHER = "other"


class ComputationError(RuntimeError):
    """The input is valid, but the result cannot be computed from it.

    Attributes:
        reason: the kind of reason; the message has the particulars.
    """

    def __init__(self, message: str, reason: Reason = Reason.OTHER) -> None:
        super().__init__(message)
        self.reason = reason

    def __reduce__(self) -> tuple[type["ComputationError"], tuple[str, Reason]]:
        return type(self), (str(self), self.reason)


class DiskError(ComputationError):
    """A disk is full or fails: the same request may succeed later, so this is no result that may be kept."""
