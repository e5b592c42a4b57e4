"""What the commands of the population and of the worlds have in common: estimates into a file, and a report of it."""

import argparse
import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from baryscope.models.errors import InputError
from baryscope.streams import drop_output
from baryscope.study.population.running import Line, Task, append, lines_of, run


def add_run(commands: Any, what: str, methods: Collection[str], usual: Sequence[str], limit: float) -> Any:
    """The parser of `run` of suites that estimate; what: is estimated; methods: that can be chosen."""

    def chosen(text: str) -> list[str]:
        names = text.split(",")
        for name in names:
            if name not in methods:
                raise argparse.ArgumentTypeError(f"found {name!r}, expected some of {', '.join(methods)}")
        return names

    parser = add_filling(commands, f"estimate {what}", "an estimate", limit)
    parser.add_argument("--methods", type=chosen, default=list(usual))
    return parser


def add_filling(commands: Any, what: str, each: str, limit: float) -> Any:
    """The parser of `run` of any suite, with what `fill` needs.

    what: is done, in words, with each of what else; limit: of the time for one, s.
    """
    parser = commands.add_parser("run", help=f"{what} that the file does not have yet, and add them to it")
    parser.add_argument("--seed", type=natural, default=1)
    parser.add_argument("--workers", type=positive, default=1)
    parser.add_argument("--limit", type=float, default=limit, help=f"s for {each}, then its process is killed")
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser


def add_report(commands: Any, tables: str) -> Any:
    """The parser of `report`; tables: that it prints."""
    parser = commands.add_parser("report", help=f"{tables} of a file of results")
    parser.add_argument("results", type=Path, nargs="+")
    return parser


def natural(text: str) -> int:
    """A whole number from 0 on."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"found {text!r}, expected a whole number from 0 on")
    return int(text)


def positive(text: str) -> int:
    """A whole number above 0."""
    if natural(text) == 0:
        raise argparse.ArgumentTypeError("found 0, expected a whole number above it")
    return natural(text)


def executed(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> int:
    """Run the chosen command: 0 if it could do what it is asked for. A wrong file ends the program with one line, and a
    reader who has seen enough with none.
    """
    options = parser.parse_args(arguments)
    try:
        options.run(options)
        sys.stdout.flush()
    except BrokenPipeError:
        drop_output()
        return 1
    except InputError as error:
        parser.exit(2, f"{parser.prog}: {error}\n")
    return 0


def fill(
    options: argparse.Namespace,
    function: Callable[..., Line],
    names: Sequence[str],
    groups: Sequence[Sequence[Task]],
    silent: Line | None = None,
) -> None:
    """Add the lines that a function makes of the tasks to the file of the options, but of those that it has.

    names: of a task's parts, which tell it in a line; silent: parts with the value at which a line leaves them out.
    """
    silent = silent or {}
    known = {tuple((silent | line)[name] for name in names) for line in lines_of(options.output)}
    left = [[task for task in group if task not in known] for group in groups]
    total = sum(map(len, left))
    for done, (task, line) in enumerate(run(function, left, options.workers, options.limit), 1):
        said = {name: part for name, part in zip(names, task, strict=True) if part != silent.get(name)}
        append(options.output, line or said | {"failure": "killed", "wall": options.limit})
        print(f"\r{done} of {total}: {', '.join(map(str, said.values())):<50}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def reported(options: argparse.Namespace) -> list[Line]:
    """The lines of all files of results.

    Raises:
        InputError: there is no such file.
    """
    for path in options.results:
        if not path.is_file():
            raise InputError(f"{path}: not found, expected a file of results")
    return [line for path in options.results for line in lines_of(path)]
