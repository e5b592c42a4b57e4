"""What the commands show: progress and remarks on standard error, results on standard output."""

import json
import textwrap
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable

from baryscope.progress import Progress as Tell
from baryscope.streams import speaks_unicode
from baryscope.table import Table

out = Console(highlight=False, markup=False)
err = Console(stderr=True, highlight=False, markup=False)

LEAST_HEADING = 9  # characters of a heading's line at least
LEAST_WIDTH = 90  # columns of a table at least, so that no number is cut off
UNTRUSTED = 3  # exit code: files are written, but the estimate is not to be trusted, or something asked for is missing
TELL_EVERY = 60.0  # s between lines of progress where there is no terminal


@Parameter(name="*")
@dataclass(frozen=True)
class Show:
    """What every command prints.

    Parameters
    ----------
    quiet
        No progress and no remarks on standard error; warnings and errors are still printed.
    json
        Print the result as one JSON document: SI units, null where there is no value.
    """

    quiet: Annotated[bool, Parameter(alias="-q", negative="")] = False
    json: Annotated[bool, Parameter(negative="")] = False

    def remark(self, text: str) -> None:
        """A line on standard error, unless quiet."""
        if not self.quiet:
            err.print(text, soft_wrap=True)

    @staticmethod
    def warn(text: str) -> None:
        """A line on standard error, even if quiet."""
        err.print(f"baryscope: {text}", soft_wrap=True)

    def result(self, data: Any, *words: str | Table | RenderableType) -> None:
        """The result: lines and tables, or the data if JSON is asked for."""
        if self.json:
            escaped = not speaks_unicode(out.encoding)
            out.print(json.dumps(data, indent=2, ensure_ascii=escaped, allow_nan=False), soft_wrap=True)
            return
        for word in words:
            if isinstance(word, Table):
                _print_table(word)
            else:
                out.print(word, soft_wrap=isinstance(word, str))

    @contextmanager
    def progress(self) -> Iterator[Tell | None]:
        """While something works: a bar with the share done and the time left, on a terminal; else lines."""
        if self.quiet:
            yield None
            return
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bars:
            yield _Display(bars)


class _Display:
    """Progress as it is told: a bar for each piece of work while it lasts, and a line with its time when it is done."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._begun: dict[str, tuple[TaskID, float]] = {}
        self._told = time.perf_counter()

    def __call__(self, work: str, share: float) -> None:
        now = time.perf_counter()
        if share <= 0:
            self._begun[work] = self._bars.add_task(work, total=None), now
            return
        task, begin = self._begun[work]
        if share >= 1:
            self._bars.remove_task(task)
            del self._begun[work]
            err.print(f"{work}: {now - begin:.2f} s", soft_wrap=True)
            return
        self._bars.update(task, total=1.0, completed=share)
        if not err.is_terminal and now - self._told >= TELL_EVERY:
            self._told = now
            left = (now - begin) * (1 - share) / share
            err.print(f"  {work}: {100 * share:.0f} %, about {_duration(left)} left", soft_wrap=True)


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _print_table(table: Table) -> None:
    """A table on the terminal, closely set where there is little room; nothing of it is cut off."""
    widths = [max([LEAST_HEADING, *(len(row[k]) for row in table.rows)]) for k in range(len(table.headings))]
    close = sum(widths) + 3 * len(widths) > out.width
    rich = RichTable(box=SIMPLE_HEAD, pad_edge=False, show_edge=not close, collapse_padding=True)
    if close:
        rich.padding = 0
    for k, (heading, width) in enumerate(zip(table.headings, widths, strict=True)):
        side: Literal["left", "right"] = "left" if k < table.left else "right"
        rich.add_column(textwrap.fill(heading, width), justify=side, no_wrap=True)  # a long heading takes two lines
    for row in table.rows:
        rich.add_row(*row)
    if table.title:
        out.print(table.title, soft_wrap=True)
    Console(file=out.file, width=max(out.width, LEAST_WIDTH), highlight=False, markup=False).print(rich)
