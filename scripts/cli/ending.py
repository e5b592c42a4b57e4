"""The end of a command that is asked for by a signal: an interrupt, so that all that it began is removed."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
USUAL = (signal.default_int_handler, signal.SIG_DFL)  # the handlers that nobody has set


class Ending:
    """Whether the end was asked for.

    Attributes:
        number: the signal that asked for it first, if one has.
    """

    def __init__(self) -> None:
        self.number: int | None = None

    def heed(self, number: int, frame: FrameType | None) -> None:
        """The handler of the signals: interrupts what is done; only Ctrl-C does so again while it is being removed.

        A library that is called may make another exception of the KeyboardInterrupt, or none.
        """
        again = self.number is not None
        if not again:
            self.number = number
        if not again or number == signal.SIGINT:
            raise KeyboardInterrupt

    @property
    def code(self) -> int | None:
        """The exit code of a process that the signal ends; None where none has."""
        return None if self.number is None else 128 + self.number


@contextmanager
def ending_by_signal() -> Iterator[Ending]:
    """While a command runs, SIGINT and SIGTERM interrupt it; whoever has another use for a signal keeps it.

    Yields:
        Whether the end was asked for.
    """
    ending = Ending()
    main = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in SIGNALS if main}
    ours = [number for number, handler in before.items() if handler in USUAL]
    for number in ours:
        signal.signal(number, ending.heed)
    try:
        yield ending
    finally:
        for number in ours:
            signal.signal(number, before[number])
