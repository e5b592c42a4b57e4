"""The two ways a request can fail, told apart because the command line's exit code tells them apart."""


class InputError(ValueError):
    """Something given by the user is wrong: one line that says where, what was found, what was expected."""


class ComputationError(RuntimeError):
    """The input is well formed, but what was asked cannot be computed from it (too few features, unobservable)."""
