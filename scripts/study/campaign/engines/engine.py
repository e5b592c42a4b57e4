"""What a campaign asks of an engine."""

from collections.abc import Generator, Iterable
from typing import Any, Protocol

from baryscope.study.campaign.case import Case

ATTEMPTS = 4  # at a case whose worker ends from outside, until it is taken for the reason


class Engine(Protocol):
    """Carries out runs somewhere."""

    def __str__(self) -> str:
        """Where, as in "100 runs in 2 processes"."""

    def carry_out(self, cases: Iterable[Case]) -> Generator[dict[str, Any], None, None]:
        """The line of each case, `run_one`, in the order in which they end; cases are asked for one by one.

        The case of a worker that is ended from outside is run again by another, a few times. Closing the generator
        stops what is still running.

        Raises:
            ComputationError: a case ends every worker that runs it, or there is no more to run on.
            DiskError: a worker has no room for its files.
            InputError: a worker runs another program.
        """
        ...
