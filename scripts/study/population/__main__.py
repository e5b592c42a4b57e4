"""`python -m baryscope.study.population run | case | report`: see docs/population.md."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import argparse  # noqa: E402
import json  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

from baryscope.estimator import METHODS, Estimate  # noqa: E402
from baryscope.study.population.judging import judged, of_estimate, prepared, tried  # noqa: E402
from baryscope.study.population.report import failing, refusals, table  # noqa: E402
from baryscope.study.population.running import append, lines_of, run  # noqa: E402

USUAL = "pivot,ml,ekf,score"
BOTH = (True, False)  # with the orbit, and without


def main(arguments: list[str] | None = None) -> int:
    """The command: 0 if it could do what it is asked for."""
    parser = argparse.ArgumentParser(prog="python -m baryscope.study.population", description=__doc__)
    commands = parser.add_subparsers(required=True)
    runner = commands.add_parser("run", help="estimate cases that the file does not have yet, and add them to it")
    runner.add_argument("--seed", type=int, default=1)
    runner.add_argument("--cases", type=int, default=200)
    runner.add_argument("--first", type=int, default=0, help="index of the first case")
    runner.add_argument("--methods", default=USUAL)
    runner.add_argument("--workers", type=int, default=1)
    runner.add_argument("--limit", type=float, default=60.0, help="s for an estimate, then its process is killed")
    runner.add_argument("-o", "--output", type=Path, required=True)
    runner.set_defaults(run=_run)
    one = commands.add_parser("case", help="one estimate in detail")
    one.add_argument("--seed", type=int, default=1)
    one.add_argument("--index", type=int, required=True)
    one.add_argument("--method", default="pivot", choices=METHODS)
    one.add_argument("--orbit", action="store_true")
    one.add_argument("--tracks", type=Path, help="also write the tracks to this CSV file")
    one.set_defaults(run=_case)
    reporter = commands.add_parser("report", help="the tables of a file of results")
    reporter.add_argument("results", type=Path, nargs="+")
    reporter.add_argument("--failing", action="store_true", help="also a line for each failing case")
    reporter.set_defaults(run=_report)
    options = parser.parse_args(arguments)
    options.run(options)
    return 0


def _run(options: argparse.Namespace) -> None:
    known = {_key(line) for line in lines_of(options.output)}
    indices = range(options.first, options.first + options.cases)
    groups = [
        [task for m in options.methods.split(",") for o in BOTH if (task := (options.seed, i, m, o)) not in known]
        for i in indices
    ]
    total = sum(map(len, groups))
    for done, (task, line) in enumerate(run(judged, groups, options.workers, options.limit), 1):
        killed = dict(zip(("seed", "index", "method", "orbit"), task, strict=True))
        append(options.output, line or killed | {"failure": "killed", "wall": options.limit})
        print(f"\r{done} of {total}, case {task[1]}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


def _key(line: dict[str, Any]) -> tuple[Any, ...]:
    return line["seed"], line["index"], line["method"], line["orbit"]


def _case(options: argparse.Namespace) -> None:
    case, sample, facts = prepared(options.seed, options.index)
    if options.tracks:
        sample.tracks.write_csv(options.tracks)
    found = tried(case, sample, options.method, options.orbit)
    answer = of_estimate(found, case.path) if isinstance(found, Estimate) else {"failure": f"{found}"}
    seen = sample.tracks.seen
    facts |= {"observations": int(seen.sum()), "frames of 3": int((seen.sum(axis=1) > 2).sum())}
    print(json.dumps(facts | {"orbit": vars(case.orbit), "sensor": vars(case.sensor)} | answer, indent=1))


def _report(options: argparse.Namespace) -> None:
    lines = [line for path in options.results for line in lines_of(path)]
    print(table(lines).markdown(), refusals(lines).markdown(), sep="\n\n")
    if options.failing:
        print("", *failing(lines), sep="\n")


if __name__ == "__main__":
    sys.exit(main())
