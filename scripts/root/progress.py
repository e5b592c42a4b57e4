"""How far a piece of work is: told to whoever asked, shown by nobody here."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]
"""Called with a piece of work and the share of it that is done: 0 at its start, in between now and then, 1 at its end.

The end is told once. A piece of work that fails has no end.
"""

Share = Callable[[float], None]


@contextmanager
def stage(progress: Progress | None, work: str) -> Iterator[Share]:
    """Tell the start and the end of a piece of work.

    Yields:
        A function that tells the share done, 0 to 1.
    """

    def tell(share: float) -> None:
        if progress is not None and 0 < share < 1:
            progress(work, share)

    if progress is not None:
        progress(work, 0.0)
    yield tell
    if progress is not None:
        progress(work, 1.0)
