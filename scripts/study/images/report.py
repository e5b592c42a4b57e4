"""The table of the images: what was tracked, errors beside claims."""

from collections.abc import Sequence

import numpy as np

from baryscope.study.population.running import Line
from baryscope.study.world.report import band
from baryscope.table import Table


def table(lines: Sequence[Line]) -> Table:
    """A row for each method and noise: root mean squares over the seeds whose answers the method trusts itself; NEES as
    the mean over these and over times.
    """
    groups: dict[tuple[float, str], list[Line]] = {}
    for line in lines:
        groups.setdefault((line["noise"], line["method"]), []).append(line)
    headings = (
        "noise, method, seeds, pairs, features, in a pair, px, rms error mm, median mm, claimed mm, NEES, 95 % band"
    )
    rows = tuple(_row(noise, method, group) for (noise, method), group in groups.items())
    return Table(tuple(f"{headings}, announced, refused".split(", ")), rows, left=2)


def _row(noise: float, method: str, group: list[Line]) -> tuple[str, ...]:
    given = [line for line in group if "rmse" in line]
    answers = [line for line in given if not line["announced"]]
    seen = [np.mean([line[key] for line in group]) for key in ("frames", "features")]
    at_a_time = np.mean([line["observations"] / line["frames"] for line in group])
    pixels = np.sqrt(np.mean([line["pixel_noise"] ** 2 for line in group]))
    head = (f"{noise:g}", method, str(len(group)), *(f"{mean:.0f}" for mean in (*seen, at_a_time)), f"{pixels:.3f}")
    last = (str(len(given) - len(answers)), str(len(group) - len(given)))
    if not answers:
        return (*head, *["-"] * 5, *last)
    errors, claims = (np.array([line[key] for line in answers]) for key in ("rmse", "predicted_rmse"))
    low, high = band(len(answers))
    return (
        *head,
        f"{1e3 * np.sqrt(np.mean(errors**2)):.3g}",
        f"{1e3 * np.median(errors):.3g}",
        f"{1e3 * np.sqrt(np.mean(claims**2)):.3g}",
        f"{np.mean([line['nees'] for line in answers]):.3g}",
        f"{low:.2f}–{high:.2f}",
        *last,
    )
