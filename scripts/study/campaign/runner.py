"""Carrying out a campaign: the runs that are missing, in several processes."""

from contextlib import closing
from pathlib import Path

from baryscope.models.errors import DiskError
from baryscope.models.files import AnyPath, refuse_overwriting, temporary_folder
from baryscope.models.scenario import Scenario
from baryscope.models.words import counted
from baryscope.report import write_report
from baryscope.study.campaign.case import Case, run_one
from baryscope.study.campaign.folder import HEADER, RUNS, RunFile, begin, read_plan, read_runs
from baryscope.study.campaign.html_report import report_of_campaign
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.pool import results_of, usable_cores
from baryscope.study.campaign.report import write_summary
from baryscope.study.campaign.summary import CampaignSummary
from baryscope.study.flight import build_unit
from baryscope.study.progress import Progress, stage

SUMMARY, PAGE = "summary.md", "report.html"


def run(plan: Plan, folder: AnyPath, workers: int | None = None, progress: Progress | None = None) -> CampaignSummary:
    """Carry out the runs of a campaign that are not in its folder yet, and write its summary.

    What comes out does not depend on the number of workers. An interrupted campaign goes on when it is run again.

    Args:
        plan: what to run, see `plan_of`.
        folder: where campaign.json, runs.jsonl, summary.md and report.html are written.
        workers: how many processes; one for each usable core unless given.
        progress: told how far the work is.

    Raises:
        InputError: the folder holds runs of another plan, or cannot be written.
        ComputationError: a unit cannot be built, or a worker was killed; what has ended is kept.
        DiskError: the disk is full; the message says what is kept.
        KeyboardInterrupt: the user stops it; the message says what is kept.
    """
    folder = Path(folder)
    plan = begin(folder, plan)
    done = read_runs(folder, plan, mend=True)
    ended = len(done)
    try:
        with temporary_folder() as units:
            cases = _missing(plan, set(done), units, progress)
            crew = min(workers or usable_cores(), len(cases))
            if cases:
                with (
                    stage(
                        progress, f"{counted(len(cases), 'run')} in {counted(crew, 'process', 'processes')}"
                    ) as share,
                    closing(results_of(run_one, cases, crew)) as results,
                    RunFile(folder) as file,
                ):
                    for count, line in enumerate(results, start=1):
                        file.append(line)
                        ended += 1
                        share(count / len(cases))
    except KeyboardInterrupt:
        kept = f"interrupted after {ended} of {plan.total} runs, which are kept in {folder}"
        raise KeyboardInterrupt(f"{kept}; the same command goes on") from None
    except DiskError as error:
        kept = f"{ended} of {plan.total} runs are kept in {folder}"
        raise DiskError(f"{error}; {kept}, and the same command goes on when there is room") from error
    return report(folder)


def campaign_paths(folder: AnyPath) -> tuple[Path, ...]:
    """The files of a campaign: its plan, its runs, its summary and its report."""
    return tuple(Path(folder) / name for name in (HEADER, RUNS, SUMMARY, PAGE))


def report(folder: AnyPath) -> CampaignSummary:
    """The summary of the runs that have ended, also while others go on; if there are some, in files, too.

    These are summary.md and report.html.

    Raises:
        InputError: the folder holds no campaign.
    """
    folder = Path(folder)
    plan = read_plan(folder)
    summary = CampaignSummary(plan, read_runs(folder, plan))
    if summary.runs:
        refuse_overwriting([folder / SUMMARY, folder / PAGE], [folder / HEADER, folder / RUNS])
        write_summary(summary, folder / SUMMARY)
        write_report(report_of_campaign(summary), folder / PAGE)
    return summary


def _missing(plan: Plan, done: set[tuple[str, int]], folder: Path, progress: Progress | None) -> list[Case]:
    """The cases left, with a unit for each number of features; a draw of all scenarios comes before the next draw."""
    left = [
        (entry, number) for number in range(plan.draws) for entry in plan.entries if (entry.name, number) not in done
    ]
    units: dict[int, Path] = {}
    for entry, _ in left:
        if entry.features not in units:
            scenario = Scenario.parse(entry.data, entry.name)
            units[entry.features] = build_unit(scenario, folder / f"{entry.features}.fmu", progress)
    return [
        Case(entry.data, number, plan.seed, plan.methods, plan.vary, str(units[entry.features]))
        for entry, number in left
    ]
