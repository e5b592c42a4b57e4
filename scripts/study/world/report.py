"""The table of the worlds: errors beside claims, and both beside the posterior bound."""

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from baryscope.study.population.running import Line
from baryscope.table import Table


def table(lines: Sequence[Line]) -> Table:
    """A row for each world and method: root mean squares over the draws; NEES as the mean over draws and times."""
    groups: dict[tuple[str, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line["world"], line["method"]), []).append(line)
    headings = "world, method, draws, rms error mm, claimed mm, NEES, 95 % band, bound mm, rms/bound"
    more = "told bound mm, rms/told bound, announced, refused, density, time s"
    rows = tuple(_row(world, method, group) for (world, method), group in groups.items())
    return Table(tuple(f"{headings}, {more}".split(", ")), rows, left=2)


def band(draws: int) -> tuple[float, float]:
    """Where the mean NEES of so many draws lies in 95 % of all suites if the covariances are true."""
    low, high = chdtri(3 * draws, [0.975, 0.025]) / draws
    return float(low), float(high)


def _row(world: str, method: str, group: list[Line]) -> tuple[str, ...]:
    answers = [line for line in group if "rmse" in line]
    refused = str(len(group) - len(answers))
    if not answers:
        return (world, method, str(len(group)), *["-"] * 9, refused, "-", "-")
    error, claimed, bound = (_rms([line[key] for line in answers]) for key in ("rmse", "predicted_rmse", "bound"))
    every = np.array([line["nees"] for line in answers])
    low, high = band(len(answers))
    told = _rms([line.get("told_bound", np.nan) for line in answers])
    density = [value for line in answers if (value := line.get("density")) is not None]
    return (
        world,
        method,
        str(len(group)),
        f"{1e3 * error:.3g}",
        f"{1e3 * claimed:.3g}",
        f"{every.mean():.3g}",
        f"{low:.2f}–{high:.2f}",
        f"{1e3 * bound:.3g}",
        f"{error / bound:.2f}",
        *(("-", "-") if np.isnan(told) else (f"{1e3 * told:.3g}", f"{error / told:.2f}")),
        str(sum(line["announced"] for line in answers)),
        refused,
        f"{np.median(density):.1e}" if density else "-",
        f"{np.median([line['wall'] for line in group]):.2f}",
    )


def _rms(values: list[float | None]) -> float:
    return float(np.sqrt(np.mean([value**2 for value in values if value is not None])))
