"""What a campaign's files cost with many draws: the report's time, its memory and its size.

    python scripts/benchmarks/campaign_scale.py FOLDER [--lines 10000,100000]

FOLDER holds a campaign that has run, of one scenario. Its runs are written again as those of other draws, one after the
other as a campaign writes them, until there are so many; then a process of its own makes the report. Draws cost as much
time as they do, whatever their number: `time` in the table of FOLDER.
"""

from baryscope.threads import prefer_one_thread

prefer_one_thread()

import json  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import dataclass, replace  # noqa: E402
from multiprocessing import get_context  # noqa: E402
from multiprocessing.queues import SimpleQueue  # noqa: E402
from pathlib import Path  # noqa: E402
from time import perf_counter  # noqa: E402

from baryscope.models.errors import InputError  # noqa: E402
from baryscope.scripts.cli.console import Show  # noqa: E402
from baryscope.study.campaign import begin, campaign_paths, mended, read_plan, report  # noqa: E402
from baryscope.study.campaign.folder import RUNS, RunFile  # noqa: E402
from baryscope.study.campaign.runner import PAGE, TABLE  # noqa: E402
from baryscope.table import Table  # noqa: E402

LINES = (10_000, 100_000)


@dataclass(frozen=True)
class Cost:
    """What so many lines cost: appending one, resuming, the report (s), its peak memory and the files (bytes)."""

    lines: int
    append: float
    resume: float
    report: float
    memory: int
    sizes: tuple[int, ...]


def multiplied(source: Path, target: Path, count: int) -> float:
    """Write the runs of a campaign as those of `count` draws.

    Returns:
        The time of a line, s.

    Raises:
        InputError: the source has several scenarios, or no runs.
    """
    plan = read_plan(source)
    runs = [json.loads(line) for line in (source / RUNS).read_text(encoding="utf-8").splitlines()]
    if len(plan.entries) != 1 or not runs:
        raise InputError(f"{source}: found {len(plan.entries)} scenarios and {len(runs)} runs, expected runs of one")
    many = begin(target, replace(plan, draws=count))
    name = many.entries[0].name
    taken = 0.0
    with RunFile(target) as file:
        for number in range(count):
            run = runs[number % len(runs)]
            values = run["varied"] | dict(many.case(name, number).values)
            line = run | {"plan": many.identity, "case": number, "varied": values}
            start = perf_counter()
            file.append(line)
            taken += perf_counter() - start
    return taken / count


def cost_of(folder: Path, append: float) -> Cost:
    """What it costs to go on with a folder and to report it."""
    plan = read_plan(folder)
    start = perf_counter()
    count = mended(folder, plan).count
    resumed = perf_counter() - start
    context = get_context("spawn")
    answer: SimpleQueue[tuple[float, int]] = context.SimpleQueue()
    process = context.Process(target=_report, args=(folder, answer))
    process.start()
    taken, memory = answer.get()
    process.join()
    sizes = tuple(path.stat().st_size for path in campaign_paths(folder) if path.name in (RUNS, TABLE, PAGE))
    return Cost(count, append, resumed, taken, memory, sizes)


def _report(folder: Path, answer: "SimpleQueue[tuple[float, int]]") -> None:
    """In a process of its own: time, and its peak memory."""
    import resource  # not on Windows

    start = perf_counter()
    report(folder)
    unit = 1 if sys.platform == "darwin" else 1024
    answer.put((perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit))


def table_of(costs: Sequence[Cost]) -> Table:
    """A row for each number of lines."""
    headings = ("lines", "append, ms", "resume, s", "report, s", "memory, MB", RUNS, TABLE, f"{PAGE}, MB")
    rows = [
        (
            str(cost.lines),
            f"{1e3 * cost.append:.2f}",
            f"{cost.resume:.1f}",
            f"{cost.report:.1f}",
            f"{cost.memory / 1e6:.0f}",
            *(f"{size / 1e6:.2f}" for size in cost.sizes),
        )
        for cost in costs
    ]
    return Table(headings, tuple(rows))


def main(source: Path, lines: Sequence[int]) -> None:
    """Print the table."""
    costs = []
    for count in lines:
        with tempfile.TemporaryDirectory(prefix="baryscope-") as name:
            folder = Path(name) / "many"
            costs.append(cost_of(folder, multiplied(source, folder, count)))
    Show().result({}, table_of(costs))


if __name__ == "__main__":
    given = sys.argv[1:]
    numbers = given[given.index("--lines") + 1] if "--lines" in given else ",".join(map(str, LINES))
    main(Path(given[0]), [int(number) for number in numbers.split(",")])
