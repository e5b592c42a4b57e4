"""The end of a command that is asked for by SIGTERM: that of an interrupt, so that all that it began is removed."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

TERMINATED = 128 + signal.SIGTERM  # the exit code, as of a process that the signal ends


class Ending:
    """Whether the end was asked for.

    Attributes:
        asked: it was.
    """

    def __init__(self) -> None:
        self.asked = False

    def heed(self, number: int, frame: FrameType | None) -> None:
        """The handler of the signal: interrupts what is done, once; then it is being removed already."""
        if not self.asked:
            self.asked = True
            raise KeyboardInterrupt


@contextmanager
def ending_by_signal() -> Iterator[Ending]:
    """While a command runs, SIGTERM interrupts it; whoever has another use for the signal keeps it.

    Yields:
        Whether the end was asked for.
    """
    ending = Ending()
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield ending
        return
    signal.signal(signal.SIGTERM, ending.heed)
    try:
        yield ending
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
