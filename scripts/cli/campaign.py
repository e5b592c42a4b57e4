"""`baryscope campaign`: scenarios drawn many times, and how near each method comes to the bound."""

import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from baryscope.fmu import build_fmu
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.scenario import Scenario
from baryscope.models.words import counted
from baryscope.scripts.cli.console import Report, err, out, step
from baryscope.study.campaign.case import Case, run_one
from baryscope.study.campaign.folder import RunFile, begin, read_plan, read_runs
from baryscope.study.campaign.plan import Plan, plan_of
from baryscope.study.campaign.pool import results_of, usable_cores
from baryscope.study.campaign.report import campaign_tables, write_summary

TABLE_WIDTH = 90  # columns at least, so that no number is cut off
TELL_EVERY = 60.0  # s between lines of progress where there is no terminal


def campaign(
    *,
    scenario: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    suite: str | None = None,
    methods: str | None = None,
    draws: int = 100,
    seed: int = 1,
    vary: str = "attitude,anomaly",
    workers: int | None = None,
    restart: Annotated[bool, Parameter(negative="")] = False,
    report: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
) -> None:
    """Draw scenarios many times, estimate with every method, and compare the errors with the Cramér–Rao bound.

    Each run is written as it ends; a campaign that was interrupted goes on when the same command is given again.
    Writes campaign.json, runs.jsonl and summary.md. What comes out does not depend on the number of workers.

    Parameters
    ----------
    scenario
        Presets (see `baryscope scenarios`) or scenario files, FILE.toml; envisat unless given. Of a suite: the names of
        those to run, all unless given.
    suite
        reach, the suite of scenarios that the accuracy is promised for, or a suite's FILE.toml.
    methods
        Methods, separated by commas; screw-gpa,pivot,ml or the suite's own unless given.
    draws
        How often each scenario is drawn; more than before continues a campaign.
    seed
        Of everything random.
    vary
        What a draw varies besides noise, dropout and outliers: attitude (uniform over all rotations), anomaly (the
        place on the orbit), both, or none.
    workers
        Worker processes; one for each core unless given.
    restart
        Forget the runs that are there.
    report
        Run nothing, only make the tables of the runs that are there.
    output
        The folder to write to; out/campaign- and the suite's or the scenarios' names unless given.
    """
    wanted = workers if workers is not None else usable_cores()
    if wanted < 1:
        raise InputError(f"--workers: found {workers}, expected at least 1")
    if report and restart:
        raise InputError("--report: found beside --restart, expected one of them")
    if report and output is not None:
        folder, plan = output, read_plan(output)
    else:
        plan = plan_of(scenario or [], suite, methods, draws=draws, seed=seed, vary=vary)
        names = [] if suite is None else [Path(suite).stem]
        names += [entry.name for entry in plan.entries] if scenario or suite is None else []
        folder = output or Path("out") / "-".join(["campaign", *names])
        plan = read_plan(folder) if report else begin(folder, plan, restart=restart)
    if not report:
        _run_missing(plan, folder, wanted)
    runs = read_runs(folder, plan)
    if not runs:
        raise InputError(f"{folder}: holds no runs yet, expected some to report")
    wide = Console(file=out.file, width=max(out.width, TABLE_WIDTH), highlight=False, markup=False)
    for table in campaign_tables(plan, runs):
        wide.print(table, soft_wrap=isinstance(table, str))
    write_summary(plan, runs, folder / "summary.md")
    out.print(f"More in {folder / 'summary.md'}", soft_wrap=True)
    failures = [outcome.get("failure") for run in runs.values() for outcome in run["methods"].values()]
    if all(failures):
        raise ComputationError(f"no run gave a result; the first says: {failures[0]}")


def _run_missing(plan: Plan, folder: Path, workers: int) -> None:
    """Carry out the runs that are not there yet."""
    done = read_runs(folder, plan, mend=True)
    total = len(plan.entries) * plan.draws
    if len(done) == total:
        err.print(f"nothing to run: {counted(total, 'run is', 'runs are')} there", soft_wrap=True)
        return
    if done:
        err.print(f"{len(done)} of {counted(total, 'run')} there; going on", soft_wrap=True)
    ended = len(done)
    try:
        with tempfile.TemporaryDirectory(prefix="baryscope-") as units:
            with step("building the units"):
                cases = _missing_cases(plan, set(done), Path(units))
            title = f"{counted(len(cases), 'run')} in {counted(min(workers, len(cases)), 'process', 'processes')}"
            with (
                step(title) as report,
                closing(results_of(run_one, cases, workers)) as results,
                RunFile(folder) as file,
            ):
                told = _Teller(report, len(cases))
                for count, run in enumerate(results, start=1):
                    file.append(run)
                    ended += 1
                    told.tell(count)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"interrupted after {ended} of {total} runs, which are kept in {folder}; the same command goes on"
        ) from None


def _missing_cases(plan: Plan, done: set[tuple[str, int]], folder: Path) -> list[Case]:
    """The cases left, with a unit for each number of features; a draw of all scenarios comes before the next draw."""
    units: dict[int, Path] = {}
    for entry in plan.entries:
        scenario = Scenario.parse(entry.data, entry.name)
        count = len(scenario.features.points)
        if count not in units:
            units[count] = build_fmu(scenario, folder / f"{count}.fmu")
    return [
        Case(entry.data, number, plan.seed, plan.methods, plan.vary, str(units[len(entry.data["features"]["points"])]))
        for number in range(plan.draws)
        for entry in plan.entries
        if (entry.name, number) not in done
    ]


class _Teller:
    """Progress: the bar of a terminal, else a line now and then."""

    def __init__(self, report: Report, total: int) -> None:
        self._report, self._total = report, total
        self._begin = self._told = time.perf_counter()

    def tell(self, count: int) -> None:
        self._report(count / self._total)
        now = time.perf_counter()
        if err.is_terminal or now - self._told < TELL_EVERY:
            return
        self._told = now
        left = (now - self._begin) * (self._total - count) / count
        err.print(f"  {count} of {self._total} runs, about {left / 60:.0f} min left", soft_wrap=True)
