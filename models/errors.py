"""The kinds of failure; the command line ends with exit code 2 for the first and 1 for the others."""


class InputError(ValueError):
    """An input is wrong. The message is one line: where, what was found, what was expected."""


class ComputationError(RuntimeError):
    """The input is valid, but the result cannot be computed from it (too few features, not observable)."""


class DiskError(ComputationError):
    """A disk is full or fails: the same request may succeed later, so this is no result that may be kept."""
