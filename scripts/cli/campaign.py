"""`baryscope campaign`: scenarios drawn many times, and each method's RMSE over the Cramér–Rao bound."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import refuse_overwriting
from baryscope.models.scenario import scenario_path
from baryscope.models.words import counted
from baryscope.scripts.cli.console import Show
from baryscope.study.campaign import VARIED, CampaignSummary, Plan, begin, campaign_paths, plan_of, read_runs, run
from baryscope.study.campaign import report as report_of
from baryscope.study.campaign.runner import PAGE, SUMMARY
from baryscope.study.campaign.suite import suite_path


def campaign(
    *,
    scenario: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    suite: str | None = None,
    methods: str | None = None,
    draws: int = 100,
    seed: int = 1,
    vary: str = ",".join(VARIED),
    workers: int | None = None,
    restart: Annotated[bool, Parameter(negative="")] = False,
    report: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Path | None, Parameter(alias="-o")] = None,
    show: Show | None = None,
) -> None:
    """Draw scenarios many times, estimate with every method, and compare the errors with the Cramér–Rao bound.

    Writes campaign.json, runs.jsonl (each run as it ends), summary.md and report.html (for a browser). The same command
    again resumes a campaign that was interrupted. The results do not depend on the number of workers.

    Parameters
    ----------
    scenario
        Presets (see `baryscope scenarios`) or scenario files, FILE.toml. Default: envisat. With --suite: names of its
        scenarios. Default: all.
    suite
        A set of scenarios with target ratios of RMSE to bound: reach, the twelve of docs/campaign.md, or FILE.toml.
    methods
        Methods, separated by commas. Default: those of the suite, or screw-gpa,pivot,ml.
    draws
        Draws of each scenario; a greater number than before continues a campaign.
    seed
        Seed of all random numbers.
    vary
        What each draw varies besides noise, dropout and outliers: attitude (uniform over all rotations), anomaly (true
        anomaly, uniform over the orbit), both, or none.
    workers
        Worker processes. Default: one for each core.
    restart
        Delete the runs that are there and begin anew.
    report
        Run nothing; print the tables of the runs that are there.
    output
        Folder to write to. Default: out/campaign- and the names of suite or scenarios.
    """
    show = show or Show()
    if workers is not None and workers < 1:
        raise InputError(f"--workers: found {workers}, expected at least 1")
    if report and restart:
        raise InputError("--report: found beside --restart, expected one of them")
    if report and output is not None:
        folder = output
    else:
        chosen = None if methods is None else methods.split(",")
        plan = plan_of(scenario or [], suite, chosen, draws=draws, seed=seed, vary=_varied(vary))
        folder = output or Path("out") / _name(plan, suite, scenario)
        refuse_overwriting(campaign_paths(folder), _sources(scenario, suite))
    if report:
        summary = report_of(folder)
    else:
        plan = begin(folder, plan, restart=restart)
        _remark_on_what_is_there(plan, folder, show)
        with show.progress() as progress:
            summary = run(plan, folder, workers, progress)
    if not summary.runs:
        raise InputError(f"{folder}: holds no runs yet, expected some to report")
    _show(summary, folder, show)
    if summary.failed:
        raise ComputationError(f"no run gave a result; the first says: {summary.failures[0]}")


def _sources(scenario: list[str] | None, suite: str | None) -> list[Path]:
    """The files that a campaign reads."""
    return [scenario_path(name) for name in scenario or []] if suite is None else [suite_path(suite)]


def _varied(text: str) -> list[str]:
    """What --vary names."""
    chosen = [item.strip() for item in text.split(",") if item.strip()]
    if not chosen:
        raise InputError(f"--vary: found {text!r}, expected none or some of {', '.join(VARIED)}")
    return [] if chosen == ["none"] else chosen


def _name(plan: Plan, suite: str | None, scenario: list[str] | None) -> str:
    names = [] if suite is None else [Path(suite).stem]
    names += [entry.name for entry in plan.entries] if scenario or suite is None else []
    return "-".join(["campaign", *names])


def _remark_on_what_is_there(plan: Plan, folder: Path, show: Show) -> None:
    done = len(read_runs(folder, plan))
    if done == plan.total:
        show.remark(f"nothing to run: {counted(done, 'run is', 'runs are')} there")
    elif done:
        show.remark(f"{done} of {counted(plan.total, 'run')} there; going on")


def _show(summary: CampaignSummary, folder: Path, show: Show) -> None:
    """The tables, and what to know of them."""
    words = [word for table in summary.tables() for word in (table, "")]
    words.append(summary.about_nees())
    if summary.remarks:
        words.append(f"remarks on single draws: {len(summary.remarks)}, see summary.md")
    page = folder / PAGE
    words += [f"Report, for a browser: {page}", f"More in {folder / SUMMARY}"]
    show.result(summary.to_json() | {"folder": str(folder), "report": str(page)}, *words)
