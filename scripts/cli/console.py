"""What the subcommands show while they work: steps and progress on standard error, results on standard output."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

VERSION = version("baryscope")

out = Console(highlight=False, markup=False)
err = Console(stderr=True, highlight=False, markup=False)

Report = Callable[[float], None]


@contextmanager
def step(title: str) -> Iterator[Report]:
    """Announce a piece of work and, when it is done, say how long it took.

    Yields:
        A function that takes the share done, 0 to 1; on a terminal it moves a bar.
    """
    begin = time.perf_counter()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(title, total=None)

        def report(share: float) -> None:
            progress.update(task, total=1.0, completed=share)

        yield report
    err.print(f"{title}: {time.perf_counter() - begin:.2f} s", soft_wrap=True)
