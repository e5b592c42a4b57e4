"""What many draws say of a method: its error against the bound, and whether it knows how good it is."""

from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.special import chdtri

from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.suite import Entry
from baryscope.study.campaign.table import NEES
from baryscope.study.methods import LVLH

FloatArray = NDArray[np.float64]

DEGREES = 3  # of freedom of an error of position
COVERAGE = 0.95
# A normalised squared error that one draw in 10 000 would have, and a path's error in units of the bound.
LARGE_NEES = float(chdtri(DEGREES, 1e-4))
LARGE_RATIO = 4.0
MOST_REMARKS = 1000  # that are told one by one


@dataclass(frozen=True)
class Row:
    """One method in one scenario, over the draws in which it gave a result; None where it does not say.

    rmse: of the path over all frames and draws, m; predicted_rmse: the same as the method's covariances predict it;
    ratio: RMSE/CRB, the RMSE over the Cramér–Rao bound, with its standard error; target: what the ratio is to be at
    most; nees: mean at the first, middle and last frame; body_nees: of the CoM in the features' axes; draws, and of
    these failed and announced as not to be trusted; time: median, s.
    """

    method: str
    draws: int
    failed: int
    announced: int
    rmse: float | None
    predicted_rmse: float | None
    ratio: float | None
    ratio_error: float | None
    target: float | None
    nees: tuple[float | None, ...]
    body_nees: float | None
    time: float | None

    @property
    def reached(self) -> bool | None:
        """Whether the ratio is as small as it should be; None where nothing is asked."""
        return None if self.target is None else self.ratio is not None and self.ratio <= self.target


@dataclass(frozen=True)
class Remark:
    """A draw that deserves a look, and why."""

    scenario: str
    case: int
    method: str
    text: str


def rows_of(entry: Entry, plan: Plan, runs: pl.DataFrame) -> list[Row]:
    """A row for each method of a scenario."""
    of_scenario = runs.filter(pl.col("scenario") == entry.name)
    return [
        _row(method, of_scenario.filter(pl.col("method") == method), entry.targets.get(method.removesuffix(LVLH)))
        for method in plan.methods
    ]


def bound_of(entry: Entry, runs: pl.DataFrame) -> tuple[float | None, float | None]:
    """Root mean square over the draws, m, of the bound of the path without outliers, and with them."""
    bounds = runs.filter((pl.col("scenario") == entry.name) & (pl.col("method").to_physical() == 0))
    return _root_mean_square(bounds["bound"]), _root_mean_square(bounds["bound_inliers"])


def nees_band(draws: int) -> tuple[float, float]:
    """Between which the mean of so many NEES of three degrees of freedom is, in 95 of 100 campaigns."""
    tail = (1 - COVERAGE) / 2
    low, high = chdtri(DEGREES * draws, [1 - tail, tail]) / draws
    return float(low), float(high)


def remarks(runs: pl.DataFrame, most: int = MOST_REMARKS) -> tuple[int, list[Remark]]:
    """Draws that failed, were announced, or are off by more than chance allows; of methods that have covariances.

    Returns:
        How many remarks there are, and the first of them.
    """
    own = pl.col("predicted_rmse").is_not_null()
    nees = pl.max_horizontal(*NEES)
    notes = pl.concat_str(
        _note(pl.col("trustworthy").not_(), pl.lit("was announced")),
        _note(
            pl.col("rmse") > LARGE_RATIO * pl.col("bound"),
            pl.format("{} × CRB", (pl.col("rmse") / pl.col("bound")).round(1)),
        ),
        _note(
            nees > LARGE_NEES,
            pl.format(
                "NEES {}",
                pl.concat_str(
                    *(pl.col(name).round(0).cast(pl.Int64) for name in NEES), separator=" ", ignore_nulls=True
                ),
            ),
        ),
        _note(
            pl.col("body_nees") > LARGE_NEES,
            pl.format("NEES {} in body axes", pl.col("body_nees").round(0).cast(pl.Int64)),
        ),
        separator=", ",
        ignore_nulls=True,
    )
    failed = pl.format("failed: {}", "failure")
    of_methods = runs.select(
        "scenario",
        "case",
        pl.col("method").cast(pl.String),
        pl.when(pl.col("failure").is_not_null()).then(failed).when(own).then(notes).otherwise(pl.lit("")).alias("text"),
    )
    once = runs.filter(pl.col("method").to_physical() == 0)
    of_draws = [
        once.select("scenario", "case", pl.lit("bound").alias("method"), pl.col("bound_failure").alias("text")),
        once.select("scenario", "case", pl.lit("all").alias("method"), pl.col("warnings").alias("text"))
        .explode("text")
        .with_columns(pl.format("warning: {}", "text").alias("text")),
    ]
    found = pl.concat([*of_draws, of_methods]).filter(pl.col("text").fill_null("") != "")
    first = found.sort("scenario", "case", maintain_order=True).head(most)
    return len(found), [Remark(str(name), case, method, text) for name, case, method, text in first.iter_rows()]


def _note(condition: pl.Expr, text: pl.Expr) -> pl.Expr:
    """A text where something holds, else null."""
    return pl.when(condition).then(text).otherwise(None)


def _row(method: str, runs: pl.DataFrame, target: float | None) -> Row:
    good = runs.filter(pl.col("failure").is_null())
    ratio, error = _ratio(good.select("rmse", "bound").drop_nulls().to_numpy())
    return Row(
        method=method,
        draws=len(runs),
        failed=len(runs) - len(good),
        announced=int(good["trustworthy"].not_().sum()),
        rmse=_root_mean_square(good["rmse"]),
        predicted_rmse=_root_mean_square(good["predicted_rmse"]),
        ratio=ratio,
        ratio_error=error,
        target=target,
        nees=tuple(_mean(good[name]) for name in NEES),
        body_nees=_mean(good["body_nees"]),
        time=_float(good["time"].median()),
    )


def _ratio(pairs: FloatArray) -> tuple[float | None, float | None]:
    """√(mean e² / mean b²) of pairs (e, b), and its standard error to first order (that of a ratio of two means)."""
    if not len(pairs):
        return None, None
    e, b = pairs.T**2
    ratio = float(np.sqrt(e.mean() / b.mean()))
    if len(pairs) < 2 or ratio == 0:
        return ratio, None
    deviation = np.std(e - ratio**2 * b, ddof=1) / np.sqrt(len(pairs)) / b.mean()
    return ratio, float(deviation / (2 * ratio))


def _root_mean_square(values: pl.Series) -> float | None:
    squared = _float((values**2).mean())
    return None if squared is None else float(np.sqrt(squared))


def _mean(values: pl.Series) -> float | None:
    return _float(values.mean())


def _float(value: object) -> float | None:
    return value if isinstance(value, float) else None
