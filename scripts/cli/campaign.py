"""`baryscope campaign`: scenarios drawn many times, and each method's RMSE over the Cramér–Rao bound."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import check_outputs
from baryscope.models.scenario import scenario_path
from baryscope.models.words import counted
from baryscope.scripts.cli.console import Show
from baryscope.scripts.cli.options.whole import Whole
from baryscope.study.campaign import (
    Plan,
    Shard,
    begin,
    campaign_paths,
    connected,
    mended,
    merge,
    plan_of,
    shard_of,
)
from baryscope.study.campaign import report as report_of
from baryscope.study.campaign.folder import alone_in, read_plan
from baryscope.study.campaign.runner import PAGE, SUMMARY, carry_out
from baryscope.study.campaign.suite import read_suite

if TYPE_CHECKING:
    from baryscope.study.campaign import CampaignSummary

campaign = App(name="campaign", result_action="return_value")

Names = Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")]


@campaign.default
def run_campaign(
    *,
    scenario: Names = None,
    suite: str | None = None,
    methods: str | None = None,
    draws: Whole | None = None,
    seed: Whole | None = None,
    vary: Names = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
    shard: str | None = None,
    restart: Annotated[bool, Parameter(negative="")] = False,
    report: Annotated[bool, Parameter(negative="")] = False,
    flights: float | None = None,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Draw scenarios many times, estimate with every method, and compare the errors with the Cramér–Rao bound.

    Writes campaign.json, runs.jsonl (each run as it ends), the same as a table (runs.parquet), summary.md and
    report.html (for a browser). The same command again resumes a campaign that was interrupted. The results do not
    depend on the number of workers, nor on where they are.

    Parameters
    ----------
    scenario
        Presets (see `baryscope scenarios`) or scenario files, FILE.toml. Default: envisat. With --suite: names of its
        scenarios. Default: all.
    suite
        A study as one file, FILE.toml: scenarios, methods, draws, seed and what varies (docs/campaign.md); or reach,
        the twelve scenarios of docs/reach.md with their target ratios of RMSE to bound.
    methods
        Methods, separated by commas. Default: those of the suite, or screw-gpa,pivot,ml.
    draws
        Draws of each scenario; a greater number than before continues a campaign without ranges. Default: that of the
        suite, or 100.
    seed
        Seed of all random numbers. Default: that of the suite, or 1.
    vary
        What each draw varies besides noise, dropout and outliers: attitude (uniform over all rotations), anomaly (true
        anomaly, uniform over the orbit), and any number of the scenario as FIELD=LOW:HIGH or FIELD=LOW:HIGH:log, such
        as sensor.noise=0.005:0.05:log or target.angular_rate_deg.2=0:3 (a Latin hypercube); or none. Only what is
        listed varies. Default: that of the suite, or attitude,anomaly.
    workers
        Worker processes on this machine. Default: one for each core.
    scheduler
        Run on the workers of a dask cluster: tcp://HOST:PORT of its scheduler, or the scheduler's FILE.json.
    shard
        Run only a part of the draws, such as 3/8; `baryscope campaign merge` puts the parts' folders together.
    restart
        Delete the runs that are there and begin anew.
    report
        Run nothing; print the tables of the runs that are there. Other options, if given, have to be those of the runs.
    flights
        Seconds for flying draws again, which report.html shows in 3D and over time; 0 for none. Default: 6, and 3 for
        each further scenario, at most 60.
    output
        Folder to write to. Default: out/campaign- and the names of suite or scenarios, and of the shard.
    """
    show = show or Show()
    if workers is not None and workers < 1:
        raise InputError(f"--workers: found {workers}, expected at least 1")
    if flights is not None and not flights >= 0:
        raise InputError(f"--flights: found {flights:g}, expected seconds, at least 0")
    for one, other, there in (
        ("report", "restart", report and restart),
        ("workers", "scheduler", workers is not None and scheduler is not None),
    ):
        if there:
            raise InputError(f"--{one}: found beside --{other}, expected one of them")
    part = shard_of("1/1" if shard is None else shard)
    chosen = None if methods is None else methods.split(",")
    plan = plan_of(scenario or [], suite, chosen, draws=draws, seed=seed, vary=_varied(vary))
    named = plan.name if part.of == 1 else f"{plan.name}-{part.index}-of-{part.of}"
    folder = output or Path("out") / named
    asked = {"entries": scenario or suite, "methods": methods, "seed": seed, "vary": vary, "draws": draws}
    if report:
        _refuse_another(folder, plan, [name for name, given in asked.items() if given is not None])
    check_outputs(campaign_paths(folder), _sources(scenario, suite))
    if report:
        summary = _reported(folder, flights, show)
    else:
        with alone_in(folder):
            plan = begin(folder, plan, restart=restart)
            ended = mended(folder, plan)
            missing = sum(len(part.numbers(plan.draws, ended.of(entry.name))) for entry in plan.entries)
            _remark_on_what_is_there(ended.count, missing, show)
            _carry_out(plan, folder, workers, scheduler if missing else None, part, show)
            summary = _reported(folder, flights, show)
    _show(summary, folder, show)


@campaign.command(name="merge")
def merge_folders(
    folders: list[Path],
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    show: Show | None = None,
) -> None:
    """Put the shards of a campaign together, and write their report.

    Folders of different seeds, scenarios, methods or versions are refused.

    Parameters
    ----------
    folders
        Folders of the same campaign, each with some of its runs.
    output
        A new folder for all of them.
    """
    merge(folders, output)
    show = show or Show()
    _show(_reported(output, None, show), output, show)


def _carry_out(plan: Plan, folder: Path, workers: int | None, scheduler: str | None, part: Shard, show: Show) -> None:
    """Run the campaign, on this machine or on a cluster."""
    with ExitStack() as stack:
        client = None if scheduler is None else stack.enter_context(connected(scheduler))
        progress = stack.enter_context(show.progress())
        carry_out(plan, folder, client=client, workers=workers, shard=part, progress=progress)


def _reported(folder: Path, flights: float | None, show: Show) -> "CampaignSummary":
    with show.progress() as progress:
        return report_of(folder, flights=flights, progress=progress)


def _refuse_another(folder: Path, plan: Plan, asked: list[str]) -> None:
    """Check that the campaign that is there is one as asked for, in the fields of its plan that options name.

    Raises:
        InputError: it is not, or there is none.
    """
    there = read_plan(folder)
    wanted = replace(there, **{name: getattr(plan, name) for name in asked})
    difference = wanted.difference(there)
    if difference is None and wanted.draws != there.draws:
        difference = f"draws {there.draws}, expected {wanted.draws}"
    if difference is not None:
        raise InputError(f"{folder}: holds a campaign with {difference} as the options say")


def _sources(scenario: list[str] | None, suite: str | None) -> list[Path]:
    """The files that a campaign reads."""
    return [scenario_path(name) for name in scenario or []] if suite is None else list(read_suite(suite).files)


def _varied(items: list[str] | None) -> list[str] | None:
    """What --vary names; None where it is not given."""
    if items is None:
        return None
    chosen = [item.strip() for text in items for item in text.split(",") if item.strip()]
    if not chosen:
        raise InputError(f"--vary: found {' '.join(items)!r}, expected none or what to vary")
    return [] if chosen == ["none"] else chosen


def _remark_on_what_is_there(done: int, missing: int, show: Show) -> None:
    if not missing:
        show.remark(f"nothing to run: {counted(done, 'run is', 'runs are')} there")
    elif done:
        show.remark(f"{counted(done, 'run is', 'runs are')} there; going on with {missing}")


def _show(summary: "CampaignSummary", folder: Path, show: Show) -> None:
    """The tables, and what to know of them."""
    from baryscope.study.campaign.summary import ABOUT_SHORT  # slow to load, and workers do without

    if not summary.count:
        raise InputError(f"{folder}: holds no runs yet, expected some to report")
    words = [word for table in summary.tables() for word in (table, "")]
    words += [*ABOUT_SHORT, summary.about_nees()]
    if left := summary.plan.total - summary.count:
        words.append(f"{left} of {counted(summary.plan.total, 'run')} still missing")
    if summary.remark_count:
        words.append(f"remarks on single draws: {summary.remark_count}, see summary.md")
    page = folder / PAGE
    words += [f"Report, for a browser: {page}", f"More in {folder / SUMMARY}"]
    show.result(summary.to_json() | {"folder": str(folder), "report": str(page)}, *words)
    if summary.failed:
        raise ComputationError(f"no run gave a result; the first says: {summary.failures[0]}")
