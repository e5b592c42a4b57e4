"""The tables of the online estimator: errors beside causal bounds at some rotations, and how it ends."""

from collections.abc import Sequence

import numpy as np

from baryscope.study.online.flights import OF_POPULATIONS
from baryscope.study.online.judging import END, MARKS
from baryscope.study.population.running import Line
from baryscope.study.world.report import band
from baryscope.table import Table

TRACKING = "tracking"


def table(lines: Sequence[Line]) -> Table:
    """A row for each suite and mark, over the draws that track there: root mean squares, for populations medians.

    With a column for each method beside: the error over that method's, of the draws that it does not refuse.
    """
    headings = "suite, rotations, draws, tracking, error mm, claimed mm, bound mm, free tumble mm, error/bound"
    methods = list(
        dict.fromkeys(name for line in lines for at in line["marks"].values() for name in at.get("beside", ()))
    )
    groups: dict[tuple[str, str], list[Line]] = {
        (line["suite"], mark): [] for line in lines for mark in (*map(str, MARKS), END)
    }
    for line in lines:
        for mark, at in line["marks"].items():
            groups[line["suite"], mark].append(at)
    rows = tuple(_row(suite, mark, group, methods) for (suite, mark), group in groups.items() if group)
    beside = tuple(f"error/{method}" for method in methods)
    return Table((*f"{headings}, NEES, 95 % band".split(", "), *beside), rows, left=2)


def _row(suite: str, mark: str, group: list[Line], methods: Sequence[str]) -> tuple[str, ...]:
    right = [at for at in group if at["status"] == TRACKING]
    head = (suite, mark, str(len(group)), str(len(right)))
    if not right:
        return (*head, *["-"] * (7 + len(methods)))
    mean = np.median if suite in OF_POPULATIONS else _rms
    values = [[at[key] for at in right] for key in ("error", "claimed")]
    values += [[at["bounds"][key] for at in right] for key in ("free", "tumble")]
    ratio = _ratio(suite, values[0], values[2])
    every = np.array([at["nees"] for at in right])
    low, high = band(len(right))
    return (
        *head,
        *(f"{1e3 * float(mean(column)):.3g}" for column in values),
        f"{ratio:.2f}",
        f"{float(np.median(every) if suite in OF_POPULATIONS else every.mean()):.3g}",
        f"{low:.2f}–{high:.2f}",
        *(_over(suite, right, method) for method in methods),
    )


def _over(suite: str, right: list[Line], method: str) -> str:
    both = [(at["error"], at["beside"][method]) for at in right if at.get("beside", {}).get(method) is not None]
    return f"{_ratio(suite, *map(list, zip(*both, strict=True))):.2f}" if both else "-"


def _ratio(suite: str, errors: list[float], others: list[float]) -> float:
    if suite in OF_POPULATIONS:
        return float(np.median(np.array(errors) / np.array(others)))
    return _rms(errors) / _rms(others)


def ends(lines: Sequence[Line]) -> Table:
    """A row for each suite: how many track at the end, how many of these are wrong, and the time of a frame."""
    headings = "suite, draws, track at the end, of them wrong, tracking frames wrong, first tracks after rotations"
    groups: dict[str, list[Line]] = {}
    for line in lines:
        groups.setdefault(line["suite"], []).append(line)
    rows = []
    for suite, group in groups.items():
        tracking = sum(line["marks"][END]["status"] == TRACKING for line in group)
        first = [line["first"] for line in group if line["first"] is not None]
        wrong, each = np.mean([line["wrong"] for line in group]), sum(line["frames"] for line in group)
        rows.append(
            (
                suite,
                str(len(group)),
                str(tracking),
                str(sum(line["stray"] for line in group)),
                f"{100 * float(wrong):.2f} %",
                f"{np.median(first):.2f}" if first else "-",
                f"{1e6 * sum(line['wall'] for line in group) / each:.0f}",
            )
        )
    return Table(tuple(f"{headings}, µs a frame in Python".split(", ")), tuple(rows))


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
