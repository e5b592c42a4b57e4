"""Which draws of a campaign stand for the others, and the lines by which any of them is looked at."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from baryscope.models.words import counted
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.reading import varied_fields

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Choice:
    """A draw to be looked at.

    Attributes:
        number: of the draw.
        name: what it is, in a few words.
        reason: why this one, in a sentence or two.
        method: by which it was chosen, a label.
        rmse: of that method's path in the campaign, m; None where it gave no result.
        wall: what flight, bound and methods took in the campaign, s.
        values: of what varies, by field.
    """

    number: int
    name: str
    reason: str
    method: str
    rmse: float | None
    wall: float
    values: tuple[tuple[str, float], ...] = ()


def choices_of(plan: Plan, runs: pl.DataFrame) -> tuple[Choice, ...]:
    """The draw in the middle of a scenario's runs, see `read_runs`, and, if it is another, the worst for its claim.

    The first is the one whose error by the best method is the median of those with a result.
    """
    label = best_method(plan.methods, runs)
    own = _results(runs, label).sort("rmse", "case")
    if own.is_empty():
        number = int(runs["case"].to_numpy().min())
        reason = f"No method gave a result; draw {number} is the first."
        return (_choice(plan, runs, number, "the first", reason, label),)
    middle = (len(own) - 1) // 2
    number, least, most = own["case"][middle], own["rmse"][0], own["rmse"][-1]
    reason = (
        f"Draw {number} is in the middle: number {middle + 1} of the {counted(len(own), 'draw')} with a result, by the "
        f"RMSE of {label}, {in_mm(own['rmse'][middle])} (the least is {in_mm(least)}, the largest {in_mm(most)})."
    )
    if len(plan.methods) > 1:
        reason += f" {label} is the method with the least median here; draws without a result count as the worst."
    found = [_choice(plan, runs, number, "in the middle", reason, label)]
    worst = _worst(plan, runs)
    return (*found, worst) if worst is not None and worst.number != number else tuple(found)


def best_method(methods: Sequence[str], runs: pl.DataFrame) -> str:
    """The label with the least median RMSE; of several that fail in half of the draws the one with most results."""

    def worth(label: str) -> tuple[float, int, float]:
        results = _results(runs, label)["rmse"].to_numpy()
        errors = np.append(results, np.full(len(runs.filter(pl.col("method") == label)) - len(results), np.inf))
        return _median(errors), -len(results), _median(results)

    return min(methods, key=worth)


def code_of(plan: Plan, scenario: str, number: int) -> tuple[str, ...]:
    """Python that flies a draw again and writes its report and files, in the folder of the campaign."""
    return (
        "from baryscope.study import compare, write_comparison",
        "from baryscope.study.campaign import drawn, read_plan",
        "",
        'plan = read_plan(".")  # in the folder of this report',
        f"draw = drawn(plan.case({scenario!r}, {number}))  # or another, 0 to {plan.draws - 1}",
        f'write_comparison(compare(draw, methods={list(plan.names)!r}), "draw-{number}")',
    )


def _worst(plan: Plan, runs: pl.DataFrame) -> Choice | None:
    """The draw with the largest error for what is claimed, by the best of the methods that claim something."""
    claims = runs.filter(pl.col("failure").is_null() & (pl.col("predicted_rmse") > 0))
    labels = [label for label in plan.methods if label in set(claims["method"])]
    if not labels:
        return None
    label = best_method(labels, runs)
    ratio = pl.col("rmse") / pl.col("predicted_rmse")
    own = claims.filter(pl.col("method") == label).sort(ratio, "case", descending=[True, False])
    number, rmse, claim = own["case"][0], own["rmse"][0], own["predicted_rmse"][0]
    reason = (
        f"Draw {number} is the worst for its claim: {label} has an RMSE of {in_mm(rmse)}, {rmse / claim:.3g} times the "
        f"{in_mm(claim)} that it predicts."
    )
    return _choice(plan, runs, number, "the worst for its claim", reason, label)


def _choice(plan: Plan, runs: pl.DataFrame, number: int, name: str, reason: str, label: str) -> Choice:
    rows = runs.filter(pl.col("case") == number)
    own = rows.filter(pl.col("method") == label)
    wall = float(rows["time"].sum()) + float(own["flight_time"][0] or 0.0)
    values = [(field, own[field][0]) for field in varied_fields(plan)]
    known = tuple((field, float(value)) for field, value in values if value is not None)
    rmse = None if own["failure"][0] is not None else own["rmse"][0]
    return Choice(number, name, reason, label, rmse, wall, known)


def _results(runs: pl.DataFrame, label: str) -> pl.DataFrame:
    good = pl.col("failure").is_null() & pl.col("rmse").is_not_null()
    return runs.filter((pl.col("method") == label) & good)


def _median(values: FloatArray) -> float:
    """The lower one of an even number, so that it is finite where half of them are; infinite of none."""
    return float(np.sort(values)[(len(values) - 1) // 2]) if len(values) else float("inf")


def in_mm(metres: float) -> str:
    """A length in words."""
    return f"{1e3 * metres:.4g} mm"
