"""How far an estimate is, where nobody knows how many rounds it takes."""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Called with the share of the work that is done, from 0 to below 1."""


def silent(share: float) -> None:
    """Tell nobody."""


class Rounds:
    """Tells the share of work that has no known end: each unit of it is half of what is left."""

    def __init__(self, progress: Progress):
        self._progress = progress
        self._done = 0.0

    def did(self, work: float) -> None:
        """Tell that so many units more are done."""
        self._done += work
        self._progress(1 - 0.5**self._done)
