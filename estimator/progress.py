"""Progress of an estimate whose number of iterations is unknown."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""A function that is called with the share of the work done, from 0 to below 1."""


def silent(share: float) -> None:
    """Ignore the progress."""


class Rounds:
    """Reports the progress of work of unknown length: each unit of work is half of the remaining share."""

    def __init__(self, progress: Progress):
        self._progress = progress
        self._done = 0.0

    def did(self, work: float) -> None:
        """Report that so many more units of work are done."""
        self._done += work
        self._progress(1 - 0.5**self._done)
