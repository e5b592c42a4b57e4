"""Carrying out a campaign: the runs that are missing, on an engine."""

import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from baryscope.models.errors import ComputationError, DiskError
from baryscope.models.files import AnyPath, check_outputs, temporary_folder
from baryscope.models.words import counted
from baryscope.progress import Progress, stage
from baryscope.report import write_report
from baryscope.study.campaign.case import Case, drawn
from baryscope.study.campaign.engines import ClusterEngine, Engine, LocalEngine
from baryscope.study.campaign.folder import HEADER, RUNS, RunFile, alone_in, begin, read_plan
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.shards import ALL, Shard
from baryscope.study.campaign.units import Units

if TYPE_CHECKING:
    from distributed import Client

    from baryscope.study.campaign.reading import Ended
    from baryscope.study.campaign.summary import CampaignSummary

TABLE, SUMMARY, PAGE = "runs.parquet", "summary.md", "report.html"


def campaign(
    plan: Plan,
    folder: AnyPath | None = None,
    *,
    client: "Client | None" = None,
    workers: int | None = None,
    shard: Shard = ALL,
    progress: Progress | None = None,
) -> "CampaignSummary":
    """Carry out the runs of a campaign that are not in its folder yet, and write its summary.

    What comes out does not depend on where it runs, nor on how many workers there are. An interrupted campaign goes on
    when it is run again, also elsewhere.

    Args:
        plan: what to run, see `plan_of`.
        folder: where all files are written; out/ and the plan's name unless given.
        client: of dask.distributed, to run on its workers; in processes of this machine unless given.
        workers: how many processes; one for each usable core unless given.
        shard: which of the draws to run; all unless given.
        progress: told how far the work is.

    Raises:
        InputError: the folder holds runs of another plan, or cannot be written; another process carries out its
            campaign; a draw's values make a scenario that is not valid; a worker of the cluster runs another program.
        ComputationError: a unit cannot be built, a case ends all its workers, or the scheduler is lost; what has ended
            is kept.
        DiskError: the disk is full; the message says what is kept.
        KeyboardInterrupt: the user stops it; the message says what is kept.
    """
    folder = Path("out") / plan.name if folder is None else Path(folder)
    with alone_in(folder):
        carry_out(plan, folder, client=client, workers=workers, shard=shard, progress=progress)
        return report(folder, progress=progress)


def carry_out(
    plan: Plan,
    folder: Path,
    *,
    client: "Client | None" = None,
    workers: int | None = None,
    shard: Shard = ALL,
    progress: Progress | None = None,
) -> None:
    """As `campaign`, for who is alone in the folder, and without the summary."""
    engine: Engine = LocalEngine(workers) if client is None else ClusterEngine(client)
    plan = begin(folder, plan)
    before = mended(folder, plan)
    left = {entry.name: shard.numbers(plan.draws, before.of(entry.name)) for entry in plan.entries}
    count, ended = sum(map(len, left.values())), before.count
    try:
        with temporary_folder() as built:
            if count:
                _check(plan, left, progress)
                units = Units(built, progress)
                cases = _cases(plan, left, {entry.name: units.of(entry) for entry in plan.entries if left[entry.name]})
                with (
                    stage(progress, f"{counted(count, 'run')} {engine}") as share,
                    closing(engine.carry_out(cases)) as results,
                    RunFile(folder) as file,
                ):
                    for done, line in enumerate(results, start=1):
                        file.append(line)
                        ended += 1
                        share(done / count)
    except KeyboardInterrupt:
        kept = f"interrupted after {ended} of {plan.total} runs, which are kept in {folder}"
        raise KeyboardInterrupt(f"{kept}; the same command goes on") from None
    except DiskError as error:
        kept = f"{ended} of {plan.total} runs are kept in {folder}"
        raise DiskError(f"{error}; {kept}, and the same command goes on when there is room") from error
    except ComputationError as error:
        if not ended:
            raise
        kept = f"{ended} of {plan.total} runs are kept in {folder}"
        raise ComputationError(f"{error}; {kept}, and the same command goes on") from error


def mended(folder: Path, plan: Plan) -> "Ended":
    """What has ended; a last line that was torn is cut off the file.

    Raises:
        InputError: a line that is no run of this plan.
    """
    from baryscope.study.campaign.reading import Ended, blocks_of, sound_length  # slow to load, and workers do without

    ended = Ended(plan)
    for _ in blocks_of(folder, plan, ended):
        pass
    path = folder / RUNS
    if path.exists() and path.stat().st_size > (length := sound_length(folder)):
        os.truncate(path, length)
    return ended


def campaign_paths(folder: AnyPath) -> tuple[Path, ...]:
    """The files of a campaign: its plan, its runs, these as a table, its summary and its report."""
    return tuple(Path(folder) / name for name in (HEADER, RUNS, TABLE, SUMMARY, PAGE))


def report(folder: AnyPath, *, flights: float | None = None, progress: Progress | None = None) -> "CampaignSummary":
    """The summary of the runs that have ended, also while others go on; if there are some, in files, too.

    These are runs.parquet, summary.md and report.html.

    Args:
        folder: of a campaign.
        flights: seconds in which draws are flown again for report.html; 6, and 3 for each further scenario, at most
            60, unless given.
        progress: told how far the work is.

    Raises:
        InputError: the folder holds no campaign.
    """
    from baryscope.study.campaign.flown import with_draws  # slow to load, and workers do without
    from baryscope.study.campaign.html_report import report_of_campaign
    from baryscope.study.campaign.markdown import write_summary
    from baryscope.study.campaign.summary import CampaignSummary
    from baryscope.study.campaign.table import read_runs, write_runs

    folder = Path(folder)
    plan = read_plan(folder)
    summary = CampaignSummary(plan, read_runs(folder, plan))
    if summary.count:
        check_outputs([folder / name for name in (TABLE, SUMMARY, PAGE)], [folder / HEADER, folder / RUNS])
        write_runs(summary.runs, folder / TABLE)
        write_summary(summary, folder / SUMMARY)
        write_report(with_draws(report_of_campaign(summary), summary, flights, progress), folder / PAGE)
    return summary


Left = dict[str, list[int]]  # the draws to run of each scenario


def _check(plan: Plan, left: Left, progress: Progress | None) -> None:
    """That values over ranges make valid scenarios in all draws, not only in the corners of the ranges."""
    if not plan.ranges:
        return
    count, done = sum(map(len, left.values())), 0
    with stage(progress, f"checking {counted(count, 'draw')}") as share:
        for name, numbers in left.items():
            for number in numbers:
                drawn(plan.case(name, number))
                done += 1
                if done % 100 == 0:
                    share(done / count)


def _cases(plan: Plan, left: Left, units: dict[str, str]) -> Iterator[Case]:
    """The cases left, made as they are asked for; a draw of all scenarios comes before the next draw."""
    places = {name: iter(numbers) for name, numbers in left.items()}
    following = {name: next(numbers, plan.draws) for name, numbers in places.items()}
    for number in range(plan.draws):
        for name, numbers in places.items():
            if following[name] == number:
                following[name] = next(numbers, plan.draws)
                yield plan.case(name, number, units[name])
