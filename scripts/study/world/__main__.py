"""`python -m baryscope.study.world run | report`: see docs/world.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

from baryscope.study.population.running import append, lines_of, run  # noqa: E402
from baryscope.study.world.judging import PEER, TOLD, can_be_told, judged  # noqa: E402
from baryscope.study.world.report import table  # noqa: E402
from baryscope.study.world.worlds import WORLDS  # noqa: E402


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.world", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = commands.add_parser("run", help="estimate draws that the file does not have yet, and add them to it")
    runner.add_argument("--seed", type=int, default=1)
    runner.add_argument("--draws", type=int, default=100)
    runner.add_argument("--worlds", nargs="+", default=list(WORLDS), choices=WORLDS, metavar="WORLD")
    runner.add_argument("--methods", default=f"pivot,pivot{TOLD},ml,ml{TOLD},{PEER}")
    runner.add_argument("--workers", type=int, default=1)
    runner.add_argument("--limit", type=float, default=120.0, help="s for an estimate, then its process is killed")
    runner.add_argument("-o", "--output", type=Path, required=True)
    runner.set_defaults(run=_run)
    reporter = commands.add_parser("report", help="the table of a file of results")
    reporter.add_argument("results", type=Path, nargs="+")
    reporter.set_defaults(run=_report)
    options = parser.parse_args(arguments)
    options.run(options)
    return 0


def _run(options: argparse.Namespace) -> None:
    known = {_key(line) for line in lines_of(options.output)}
    groups = [
        [
            task
            for method in options.methods.split(",")
            if (not method.endswith(TOLD) or can_be_told(WORLDS[name]))
            and (task := (name, options.seed, draw, method)) not in known
        ]
        for draw in range(options.draws)
        for name in options.worlds
    ]
    total = sum(map(len, groups))
    for done, (task, line) in enumerate(run(judged, groups, options.workers, options.limit), 1):
        killed = dict(zip(("world", "seed", "draw", "method"), task, strict=True))
        append(options.output, line or killed | {"failure": "killed", "wall": options.limit})
        print(f"\r{done} of {total}, draw {task[2]} of {task[0]:<24}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def _key(line: dict[str, Any]) -> tuple[Any, ...]:
    return line["world"], line["seed"], line["draw"], line["method"]


def _report(options: argparse.Namespace) -> None:
    lines = [line for path in options.results for line in lines_of(path)]
    order = list(WORLDS)
    print(table(sorted(lines, key=lambda line: order.index(line["world"]))).markdown())


if __name__ == "__main__":
    sys.exit(main())
