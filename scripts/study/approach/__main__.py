"""`python -m baryscope.study.approach run | report`: see docs/approach.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402

from baryscope.models.errors import InputError  # noqa: E402
from baryscope.models.words import counted  # noqa: E402
from baryscope.study.approach.flying import LOOPS, USUAL, flown  # noqa: E402
from baryscope.study.approach.report import ends, over_time, picture  # noqa: E402
from baryscope.study.pictures import pictures_possible, save  # noqa: E402
from baryscope.study.population import command  # noqa: E402


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.approach", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = command.add_filling(commands, "fly draws", "a flight", 120.0)
    runner.add_argument("--draws", type=command.positive, default=100)
    runner.add_argument("--loops", nargs="+", default=list(USUAL), choices=LOOPS, metavar="LOOP")
    runner.set_defaults(run=_run)
    reporter = command.add_report(commands, "the tables and the picture")
    reporter.add_argument("--picture", type=Path, help="also draw them into this PNG file")
    reporter.set_defaults(run=_report)
    return command.executed(parser, arguments)


def _run(options: argparse.Namespace) -> None:
    groups = [[(options.seed, draw, loop) for loop in options.loops] for draw in range(options.draws)]
    command.fill(options, flown, ("seed", "draw", "loop"), groups)


def _report(options: argparse.Namespace) -> None:
    lines = command.reported(options)
    failed = sum("failure" in line for line in lines)
    if failed == len(lines):
        raise InputError(f"{options.results[0]}: has no flight that ended, expected some")
    print(over_time(lines).markdown(), ends(lines).markdown(), sep="\n\n")
    if failed:
        print(f"\n{counted(failed, 'flight')} failed, by an error or by the limit of time, and counted nowhere above.")
    if options.picture is not None:
        if not pictures_possible():
            raise InputError(f"{options.picture}: pictures need matplotlib, expected `pip install 'baryscope[report]'`")
        save(picture(lines), options.picture)


if __name__ == "__main__":
    sys.exit(main())
