"""`python -m baryscope.study.population run | case | report`: see docs/population.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import json  # noqa: E402
import sys  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from pathlib import Path  # noqa: E402

from baryscope.estimator import METHODS, Estimate  # noqa: E402
from baryscope.estimator.methods import CLAIMING  # noqa: E402
from baryscope.study.population import command  # noqa: E402
from baryscope.study.population.ahead import predicted  # noqa: E402
from baryscope.study.population.interface import Drawn  # noqa: E402
from baryscope.study.population.judging import asked, judged, of_estimate, prepared, tried  # noqa: E402
from baryscope.study.population.populations import FIRST, POPULATIONS  # noqa: E402
from baryscope.study.population.report import by_status, draws, failing, predictions, refusals, table  # noqa: E402
from baryscope.study.population.running import Line  # noqa: E402

BOTH = (True, False)  # with the orbit, and without


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.population", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = command.add_run(commands, "cases", METHODS, CLAIMING, 60.0)
    _add_population(runner)
    runner.add_argument("--cases", type=command.natural, default=200)
    runner.add_argument("--first", type=command.natural, default=0, help="index of the first case")
    runner.add_argument("--without-orbit", action="store_true", help="only estimates to which no orbit is given")
    _add_ahead(runner)
    runner.set_defaults(run=_run)
    one = commands.add_parser("case", help="one estimate in detail")
    _add_population(one)
    one.add_argument("--seed", type=command.natural, default=1)
    one.add_argument("--index", type=command.natural, required=True)
    one.add_argument("--method", default="pivot", choices=METHODS)
    one.add_argument("--orbit", action="store_true")
    one.add_argument("--draws", type=command.positive, help="this many estimates instead, each with other noise")
    one.add_argument("--tracks", type=Path, help="also write the tracks to this CSV file")
    _add_ahead(one)
    one.set_defaults(run=_case)
    reporter = command.add_report(commands, "the tables")
    reporter.add_argument("--failing", action="store_true", help="also a line for each failing case")
    reporter.set_defaults(run=_report)
    return command.executed(parser, arguments)


def _add_population(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--population", default=FIRST, choices=POPULATIONS, help="who drew the cases")


def _add_ahead(parser: argparse.ArgumentParser) -> None:
    said = "also judge predictions, in the longest gap, a quarter of the span after the end, and one span after it"
    parser.add_argument("--ahead", action="store_true", help=said)


def _run(options: argparse.Namespace) -> None:
    indices = range(options.first, options.first + options.cases)
    orbits = (False,) if options.without_orbit else BOTH
    groups = [
        [
            (options.seed, index, method, orbit, options.population, options.ahead)
            for method in options.methods
            for orbit in orbits
        ]
        for index in indices
    ]
    names = ("seed", "index", "method", "orbit", "population", "ahead")
    command.fill(options, judged, names, groups, silent={"population": FIRST, "ahead": False})


def _case(options: argparse.Namespace) -> None:
    if options.draws:
        print(draws(list(_redrawn(options))))
        return
    case, sample, facts = prepared(options.seed, options.index, options.population)
    if options.tracks:
        sample.tracks.write_csv(options.tracks)
    found = tried(case, sample, options.method, options.orbit)
    answer = _answer(found, options, case) if isinstance(found, Estimate) else {"failure": f"{found}"}
    seen = sample.tracks.seen
    facts |= {"observations": int(seen.sum()), "frames of 3": int((seen.sum(axis=1) > 2).sum())}
    print(json.dumps(facts | {"orbit": vars(case.orbit), "sensor": vars(case.sensor)} | answer, indent=1))


def _redrawn(options: argparse.Namespace) -> Iterator[Line]:
    """The answers of a case with other noise."""
    case, sampler = POPULATIONS[options.population](options.seed, options.index)
    for draw in range(1, options.draws + 1):
        found = tried(case, sampler(draw), options.method, options.orbit)
        answer = _answer(found, options, case) if isinstance(found, Estimate) else {"failure": found.reason}
        yield {"draw": draw} | answer
        print(f"\r{draw} of {options.draws}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def _answer(found: Estimate, options: argparse.Namespace, case: Drawn) -> Line:
    """What judging says of an estimate of a case, as the options ask for it."""
    line = of_estimate(found, case.path)
    if options.ahead:
        line["predicted"] = predicted(found, asked(options.seed, options.index, options.population))
    return line


def _report(options: argparse.Namespace) -> None:
    lines = [line for line in command.reported(options) if "skipped" not in line]
    print(table(lines).markdown(), by_status(lines).markdown(), refusals(lines).markdown(), sep="\n\n")
    if any("predicted" in line for line in lines):
        print("", predictions(lines).markdown(), sep="\n")
    if options.failing:
        print("", *failing(lines), sep="\n")


if __name__ == "__main__":
    sys.exit(main())
