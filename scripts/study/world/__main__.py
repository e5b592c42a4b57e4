"""`python -m baryscope.study.world run | report`: see docs/world.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402

from baryscope.estimator import METHODS  # noqa: E402
from baryscope.study.population import command  # noqa: E402
from baryscope.study.world.judging import PEER, TOLD, can_be_told, judged  # noqa: E402
from baryscope.study.world.report import table  # noqa: E402
from baryscope.study.world.worlds import WORLDS  # noqa: E402

USUAL = ("pivot", f"pivot{TOLD}", "ml", f"ml{TOLD}", PEER)


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.world", description=__doc__)
    commands = parser.add_subparsers(required=True)
    methods = [*METHODS, *(f"{name}{TOLD}" for name in METHODS), PEER]
    runner = command.add_run(commands, "draws", methods, USUAL, 120.0)
    runner.add_argument("--draws", type=command.natural, default=100)
    runner.add_argument("--worlds", nargs="+", default=list(WORLDS), choices=WORLDS, metavar="WORLD")
    runner.set_defaults(run=_run)
    command.add_report(commands, "the table").set_defaults(run=_report)
    return command.executed(parser, arguments)


def _run(options: argparse.Namespace) -> None:
    groups = [
        [
            (name, options.seed, draw, method)
            for method in options.methods
            if not method.endswith(TOLD) or can_be_told(WORLDS[name])
        ]
        for draw in range(options.draws)
        for name in options.worlds
    ]
    command.fill(options, judged, ("world", "seed", "draw", "method"), groups)


def _report(options: argparse.Namespace) -> None:
    lines, order = command.reported(options), list(WORLDS)
    print(table(sorted(lines, key=lambda line: order.index(line["world"]))).markdown())


if __name__ == "__main__":
    sys.exit(main())
