"""`python -m baryscope.study.joints run | report`: see docs/joint.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import sys  # noqa: E402

from baryscope.study.joints.judging import judged, regions, table  # noqa: E402
from baryscope.study.joints.recordings import MOTIONS, NOISES, SLACK  # noqa: E402
from baryscope.study.population import command  # noqa: E402

METHODS = ("ml", "score")
KINDS = (*NOISES, SLACK)
PARTS = ("motion", "noise", "seed", "draw", "method")


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.joints", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = command.add_run(commands, "draws", METHODS, METHODS, 60.0)
    runner.add_argument("--draws", type=command.natural, default=200)
    runner.add_argument("--motions", nargs="+", default=list(MOTIONS), choices=MOTIONS, metavar="MOTION")
    runner.add_argument("--noises", nargs="+", default=list(KINDS), choices=KINDS, metavar="NOISE")
    runner.set_defaults(run=_run)
    reporter = command.add_report(commands, "the table")
    said = "how often the region that should hold the centre in 50 to 99 %% of draws does, instead"
    reporter.add_argument("--regions", action="store_true", help=said)
    reporter.set_defaults(run=_report)
    return command.executed(parser, arguments)


def _run(options: argparse.Namespace) -> None:
    groups = [
        [(motion, noise, options.seed, draw, method) for draw in range(options.draws) for method in options.methods]
        for motion in options.motions
        for noise in options.noises
    ]
    command.fill(options, judged, PARTS, groups)


def _report(options: argparse.Namespace) -> None:
    def place(line: dict[str, str]) -> tuple[int, int, int]:
        return list(MOTIONS).index(line["motion"]), KINDS.index(line["noise"]), METHODS.index(line["method"])

    shown = regions if options.regions else table
    print(shown(sorted(command.reported(options), key=place)).markdown())


if __name__ == "__main__":
    sys.exit(main())
