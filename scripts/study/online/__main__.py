"""`python -m baryscope.study.online run | report | endure`: see docs/online-measured.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402
from functools import partial  # noqa: E402

from baryscope.estimator.methods import PREDICTING  # noqa: E402
from baryscope.models.errors import InputError  # noqa: E402
from baryscope.study.online.endurance import endured, hours_table  # noqa: E402
from baryscope.study.online.flights import SUITES  # noqa: E402
from baryscope.study.online.judging import judged  # noqa: E402
from baryscope.study.online.report import ends, table  # noqa: E402
from baryscope.study.population import command  # noqa: E402


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.online", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = command.add_filling(commands, "fly draws", "a draw", 120.0)
    runner.add_argument("--draws", type=command.natural, default=100)
    runner.add_argument("--suites", nargs="+", default=list(SUITES), choices=SUITES, metavar="SUITE")
    runner.add_argument(
        "--beside", nargs="+", default=[], choices=PREDICTING, metavar="METHOD", help="from the same frames"
    )
    runner.set_defaults(run=_run)
    endurer = commands.add_parser("endure", help="a day of frames: time, memory, error and claim, hour by hour")
    endurer.add_argument("--hours", type=float, default=24.0)
    endurer.add_argument("--rate", type=float, default=100.0, help="frames a second")
    endurer.add_argument("--seed", type=command.natural, default=1)
    endurer.set_defaults(run=_endure)
    command.add_report(commands, "the tables").set_defaults(run=_report)
    return command.executed(parser, arguments)


def _run(options: argparse.Namespace) -> None:
    groups = [[(suite, options.seed, draw)] for suite in options.suites for draw in range(options.draws)]
    command.fill(options, partial(judged, beside=options.beside), ("suite", "seed", "draw"), groups)


def _endure(options: argparse.Namespace) -> None:
    if not (options.hours > 0 and options.rate > 0 and 3600 * options.hours * options.rate >= 1):
        raise InputError(f"endure: found {options.hours:g} hours at {options.rate:g} Hz, expected one frame at least")
    hours = []
    for hour in endured(options.hours, options.rate, options.seed):
        hours.append(hour)
        print(f"\rhour {hour.number}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(hours_table(hours, options.rate).markdown())


def _report(options: argparse.Namespace) -> None:
    order = {suite: number for number, suite in enumerate(SUITES)}
    lines = sorted(command.reported(options), key=lambda line: order[line["suite"]])
    flown = [line for line in lines if "failure" not in line]
    print(table(flown).markdown(), ends(flown).markdown(), sep="\n\n")


if __name__ == "__main__":
    sys.exit(main())
