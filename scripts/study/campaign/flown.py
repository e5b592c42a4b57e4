"""Draws of a campaign flown again for its report, within seconds and bytes that are told before."""

import math
import warnings
from contextlib import suppress
from dataclasses import dataclass
from time import perf_counter

import polars as pl

from baryscope import __version__
from baryscope.estimator.online.core import at_hand
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import temporary_folder
from baryscope.progress import Progress, stage
from baryscope.report import Report, html_of
from baryscope.report.document import Part, Tabs, Words
from baryscope.report.fitting import fitted
from baryscope.study.campaign.case import drawn
from baryscope.study.campaign.draws import Choice, choices_of, code_of, in_mm
from baryscope.study.campaign.html_report import with_parts
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.program import program_hash
from baryscope.study.campaign.suite import Entry
from baryscope.study.campaign.summary import CampaignSummary
from baryscope.study.campaign.units import Units
from baryscope.study.comparison import compare
from baryscope.study.comparison_report import parts_of_comparison

SECONDS, FURTHER, MOST_SECONDS = 6.0, 3.0, 60.0  # for one scenario, for each further one, and for all
MOST_BYTES = 5_900_000  # of a page
WORDS = 5_000  # bytes of them for each scenario
LEAST_ROOM = 150_000  # bytes, with which a draw is worth flying
PARTS, FRAME = 0.5, 3e-4  # s that a draw's parts take, and the online estimator takes for a frame
ALIKE = 1e-3  # by which errors may differ from one processor to the other

TITLE = "A draw of it"
IN_PYTHON = "Python flies any draw again, and writes its report, tracks, truth and estimates:"
NO_ONLINE = "it is not compiled yet, which takes a minute; baryscope compare does it, once and for all"
NO_ROOM = f"It is not flown again here: a page of {MOST_BYTES / 1e6:.0f} MB has no room for it."


@dataclass
class _Draw:
    """A draw to be looked at, and its parts, or why there are none."""

    entry: Entry
    choice: Choice
    cost: float = 0.0
    parts: tuple[Part, ...] = ()
    lines: tuple[str, ...] = ()
    missing: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """Which draw it is, and what to know of it."""
        values = ", ".join(f"{field} {value:.6g}" for field, value in self.choice.values)
        varied = (f"Drawn for it: {values}.",) if values else ()
        return (self.choice.reason, *varied, *self.lines, *([self.missing] if self.missing else []))


def usual_seconds(plan: Plan) -> float:
    """How long the report of a plan flies draws again, unless told."""
    return min(SECONDS + FURTHER * (len(plan.entries) - 1), MOST_SECONDS)


def with_draws(
    report: Report, summary: CampaignSummary, seconds: float | None = None, progress: Progress | None = None
) -> Report:
    """The report of a campaign with draws of its scenarios to look at, flown again here.

    Of each scenario the draw in the middle, then those worst for their claims, as many as fit into the time and the
    page; of the others, and of those that another program ran, it says how they are looked at.

    Args:
        report: what `report_of_campaign` makes.
        summary: what it is of.
        seconds: in which draws are flown; `usual_seconds` unless given.
        progress: told how far the work is.
    """
    plan = summary.plan
    entries = [entry for entry in plan.entries if summary.draws(entry)]
    chosen = [choices_of(plan, summary.runs.filter(pl.col("scenario") == entry.name)) for entry in entries]
    ranked = sorted((rank, k) for k, some in enumerate(chosen) for rank in range(len(some)))
    draws = [_Draw(entries[k], chosen[k][rank]) for rank, k in ranked]
    if plan.program != program_hash():
        for draw in draws:
            draw.missing = (
                f"It is not flown again here: the runs are of another program (baryscope {plan.version}, "
                f"{plan.program}) than this one ({__version__}, {program_hash()}), by which it may come out otherwise."
            )
    else:
        room = MOST_BYTES - len(html_of(report).encode()) - WORDS * len(entries)
        _fly(draws, plan, usual_seconds(plan) if seconds is None else seconds, room, progress)
    looks, lost = {}, []
    for entry in entries:
        own = [draw for draw in draws if draw.entry is entry]
        looks[entry.name] = (_look(plan, own),)
        lost += [entry.name] if not any(draw.parts for draw in own) else []
    none = f" Without one, as their tabs say: {', '.join(lost)}." if lost else ""
    return with_parts(report, looks, f"How the results are distributed, and a draw to look at.{none}")


def _look(plan: Plan, draws: list[_Draw]) -> Part:
    """Those draws of a scenario that were flown, and words on the others."""
    seen, others = [draw for draw in draws if draw.parts], [draw for draw in draws if not draw.parts]
    unseen = tuple(" ".join(draw.words) for draw in others)
    entry, first = draws[0].entry, draws[0].choice.number
    if not seen:
        return Words(TITLE, (*unseen, IN_PYTHON), code_of(plan, entry.name, first))
    choices: list[tuple[str, tuple[Part, ...]]] = []
    for draw in seen:
        words = Words("Which draw", (*draw.words, *(unseen if draw is seen[0] else ())))
        code = Words("Any other draw", (IN_PYTHON,), code_of(plan, entry.name, draw.choice.number))
        choices.append((f"draw {draw.choice.number}, {draw.choice.name}", (words, *draw.parts, code)))
    return Tabs(TITLE, tuple(choices), "Flown again for this report, with the parts of that of baryscope compare.")


def _fly(draws: list[_Draw], plan: Plan, seconds: float, room: int, progress: Progress | None) -> None:
    """Give the draws their parts, one after the other, or say why they have none."""
    for draw in draws:
        draw.cost = draw.choice.wall + PARTS
        with suppress(InputError):  # is said when it is flown
            draw.cost += FRAME * len(drawn(plan.case(draw.entry.name, draw.choice.number)).sample_times)
    if not any(draw.cost <= seconds for draw in draws):
        progress = None
    begin, taken, foreseen = perf_counter(), 0.0, 0.0
    try:
        with stage(progress, "flying draws again for the report") as share, temporary_folder() as folder:
            units = Units(folder)
            for k, draw in enumerate(draws):
                left = seconds - (perf_counter() - begin)
                pace = max(1.0, taken / foreseen) if foreseen else 1.0
                same = sum(1 for other in draws[k:] if other.choice.name == draw.choice.name)
                if pace * draw.cost > left:
                    total = sum(one.cost for one in draws[: k + same])
                    draw.missing = _no_time(draw, seconds, max(left, 0.0), pace * total)
                elif room < LEAST_ROOM:
                    draw.missing = NO_ROOM
                else:
                    unit, start = units.of(draw.entry), perf_counter()
                    room -= _flown(draw, plan, unit, room, max(room // same, LEAST_ROOM))
                    taken, foreseen = taken + perf_counter() - start, foreseen + draw.cost
                share((k + 1) / len(draws))
    except Exception as error:
        for draw in draws:
            draw.missing = draw.missing or ("" if draw.parts else _failed(error))


def _flown(draw: _Draw, plan: Plan, unit: str, room: int, aim: int) -> int:
    """Give a draw its parts, or say why it has none; how many bytes they are, those of the aim if they can."""
    try:
        scenario = drawn(plan.case(draw.entry.name, draw.choice.number))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what they say stands in the campaign's lines
            comparison = compare(scenario, methods=plan.names, unit=unit)
            parts, notes = parts_of_comparison(comparison, "" if at_hand() else NO_ONLINE)
            parts, weight = fitted(parts, aim)
    except Exception as error:
        draw.missing = _failed(error)
        return 0
    if weight > room:
        draw.missing = NO_ROOM
        return 0
    draw.parts = parts
    method, before = draw.choice.method, draw.choice.rmse
    now = comparison[method].rmse
    same = before == now or (before is not None and now is not None and math.isclose(before, now, rel_tol=ALIKE))
    here = f"{method} gave no result" if now is None else f"{method} has an RMSE of {in_mm(now)}"
    out = () if same else (f"It came out otherwise than in the campaign: here {here}.",)
    seed = f"All that is random in it is of SeedSequence([{plan.seed}, {draw.choice.number}]); run.seed"
    draw.lines = (*out, f"{seed} is {scenario.run.seed}.", *notes)
    return weight


def _no_time(draw: _Draw, seconds: float, left: float, total: float) -> str:
    need = math.ceil(1.2 * total) + 1
    there = f"{left:.1f} s are left of {seconds:g} s for such flights" if seconds else "no such flights are asked for"
    return (
        f"It is not flown again here: that takes about {draw.cost:.1f} s, and {there}. In this folder, "
        f"baryscope campaign --report --flights {need} -o . makes a report with it."
    )


def _failed(error: Exception) -> str:
    known = isinstance(error, ComputationError | InputError)
    words = str(error) if known else f"internal error, {type(error).__name__}: {error}"
    return f"It could not be flown again here: {words}."
