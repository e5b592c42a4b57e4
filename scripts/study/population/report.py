"""The tables of a population: how often a method answers, says so, and is right."""

from collections import Counter
from collections.abc import Sequence
from itertools import product

import numpy as np

from baryscope.estimator.methods import TURNING
from baryscope.study.population.ahead import CENTRE, FEATURE, WHEN, missed, misses
from baryscope.study.population.judging import CRASHED, wrong
from baryscope.study.population.running import Line
from baryscope.table import Table

SLOW = 5.0  # s
CLEAR = 0.25  # bound over the features' radius, below which a refusal needs a reason


def table(lines: Sequence[Line]) -> Table:
    """A row for each method, with the orbit and without.

    An answer is announced if its status is `not converged`, `model does not fit` or `not checked`; all others claim
    their covariance.
    """
    rows = tuple(_row(name, orbit, group) for (name, orbit), group in _groups(lines).items())
    headings = "method, orbit, answers, unannounced, wrong, median NEES, mean NEES, right but announced"
    more = "not definite, refused, of them clear, killed, over 5 s, rms/bound"
    return Table(tuple(f"{headings}, {more}".split(", ")), rows, left=2)


def by_status(lines: Sequence[Line]) -> Table:
    """A row for each status of the answers of a method, with the orbit and without."""
    rows = []
    for (name, orbit), group in _groups(lines).items():
        claims = [line for line in group if "nees" in line]
        for status in sorted({line["status"] for line in claims}):
            own = [line for line in claims if line["status"] == status]
            every = np.array([line["nees"] for line in own])
            count, median = str(len(own)), f"{np.median(every):.2f}"
            rows.append((name, _orbit(orbit), status, count, _share(sum(map(wrong, own)), len(own)), median))
    return Table(("method", "orbit", "status", "answers", "wrong", "median NEES"), tuple(rows), left=3)


def predictions(lines: Sequence[Line]) -> Table:
    """A row for each method, with the orbit and without, each point and each time: predictions of unannounced answers.

    Errors and claims are medians, of the position; NEES is of position and velocity. Refused: no prediction of it.
    """
    rows = []
    for (name, orbit), group in _groups(lines).items():
        made = [line["predicted"] for line in group if "predicted" in line and not line["announced"]]
        for point, when in product((CENTRE, FEATURE), WHEN):
            own = [one[f"{point} {when}"] for one in made if point not in one]
            rows.append((name, _orbit(orbit), point, when, *_of_predictions(own), str(len(made) - len(own))))
    headings = "method, orbit, point, when, predictions, wrong, median NEES, error, claimed, greatest claim, refused"
    return Table(tuple(headings.split(", ")), tuple(rows), left=4)


def _of_predictions(made: list[Line]) -> tuple[str, ...]:
    if not made:
        return "0", *5 * ("-",)
    bad = sum(map(missed, made))
    error, claimed, every = (np.array([one[name] for one in made]) for name in ("error", "claimed", "nees"))
    sizes = (f"{size:.2g} m" for size in (np.median(error), np.median(claimed), claimed.max()))
    return str(len(made)), _share(bad, len(made)), f"{np.median(every):.2f}", *sizes


def _orbit(known: bool) -> str:
    return "yes" if known else "no"


def _groups(lines: Sequence[Line]) -> dict[tuple[str, bool], list[Line]]:
    groups: dict[tuple[str, bool], list[Line]] = {}
    for line in lines:
        groups.setdefault((line["method"], line["orbit"]), []).append(line)
    return groups


def _row(name: str, orbit: bool, group: list[Line]) -> tuple[str, ...]:
    answers = [line for line in group if "status" in line]
    claims = [line for line in answers if "nees" in line]
    silent = [line for line in claims if not line["announced"]]
    bad = [line for line in silent if wrong(line)]
    right = [line for line in claims if not wrong(line)]
    every = np.array([value for line in silent for value in line["nees"]])
    refused = [line for line in group if "failure" in line and line["failure"] != "killed"]
    ratio = [line["rmse"] / bound for line in silent if (bound := bound_of(line)) is not None]
    return (
        name,
        _orbit(orbit),
        str(len(answers)),
        str(len(silent)),
        _share(len(bad), len(silent)),
        f"{np.median(every):.2f}" if every.size else "-",
        f"{every[np.isfinite(every)].mean():.3g}" if np.isfinite(every).any() else "-",
        _share(sum(line["announced"] for line in right), len(right)),
        str(sum(not line["definite"] for line in claims)),
        str(len(refused)),
        str(sum(map(clear, refused))),
        str(sum(line.get("failure") == "killed" for line in group)),
        str(sum(line["wall"] > SLOW for line in group)),
        f"{np.median(ratio):.2f}" if ratio else "-",
    )


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.1f} %)" if whole else "-"


def bound_of(line: Line) -> float | None:
    """The bound of the path's rms error for what the method knows, m; None where there is none."""
    name = ("tumble" if line["method"] in TURNING else "free") + (" orbit" if line["orbit"] else "")
    bound: float | None = line.get("bounds", {}).get(name)
    return bound


def clear(line: Line) -> bool:
    """Whether the bound is below a quarter of the features' radius."""
    bound = bound_of(line)
    return bound is not None and bound < CLEAR * line["radius"]


def refusals(lines: Sequence[Line]) -> Table:
    """The reasons of those who refuse, and how many refuse although the bound is clear."""
    refused = [line for line in lines if "failure" in line]
    reasons = Counter((line["method"], line["failure"]) for line in refused)
    without = Counter((line["method"], line["failure"]) for line in refused if clear(line))
    rows = tuple((name, why, str(n), str(without[name, why])) for (name, why), n in sorted(reasons.items()))
    return Table(("method", "reason", "refused", "of them clear"), rows, left=2)


def draws(lines: Sequence[Line]) -> Table:
    """A row for each answer to one case with other noise: the worst of its three times; their count as title."""
    silent = [line for line in lines if "nees" in line and not line["announced"]]
    bad = sum(map(wrong, silent))
    title = f"{len(lines)} draws, {len(silent)} of them answered without a remark; of these wrong: {bad}"
    return Table(("draw", "answer", "path", "error, m", "claimed, m", "NEES"), tuple(map(_drawn, lines)), title, left=3)


def _drawn(line: Line) -> tuple[str, ...]:
    if "nees" not in line:
        return str(line["draw"]), line.get("failure") or line["status"], *4 * ("-",)
    numbers = (f"{max(line[name]):.3g}" for name in ("error", "claimed", "nees"))
    return str(line["draw"]), line["status"], line["path"], *numbers


def failing(lines: Sequence[Line]) -> list[str]:
    """A line of text for each wrong answer, indefinite covariance, clear refusal, crash and slow estimate."""
    return [f"{fault:<24} {_named(line)}" for line in lines for fault in _faults(line)]


def _faults(line: Line) -> list[str]:
    if "failure" in line:
        if line["failure"] == "killed" or line["message"].startswith(CRASHED):
            faults = ["crashed"]
        else:
            faults = ["refused"] * clear(line)
    else:
        faults = ["wrong"] * ("nees" in line and not line["announced"] and wrong(line))
        faults += ["not definite"] * (not line.get("definite", True))
    faults += [f"wrong at {name}" for name in misses(line) if not line["announced"]]
    return faults + ["slow"] * (line["wall"] > SLOW) + ["warning"] * ("warnings" in line)


def _named(line: Line) -> str:
    head = f"{line['seed']} {line['index']:>4} {line['method']:<9} {'orbit' if line['orbit'] else '-':<5}"
    facts = (
        f"{line.get('frames')}×{line.get('features')} {line.get('rotations')} rot, noise {line.get('noise', 0):.2g}, "
        f"bound {bound_of(line) or np.nan:.2g}, radius {line.get('radius', 0):.2g}; {line.get('kind')}"
    )
    if "failure" in line:
        what = f"{line['failure']}: {line.get('message', '')}"
    else:
        worst = max(line.get("nees", [np.nan]))
        what = f"NEES {worst:.3g}, {line['path']}, {line['rounds']} rounds, error {max(line['error']):.2g}"
        what += f", claimed {max(line.get('claimed', [np.nan])):.2g}, {line['status']}, sigma {line['sigma']:.2g}"
    more = "; ".join(line.get("warnings", []))
    return f"{head} [{facts}] {what} {line['wall']:.1f} s {more}".rstrip()
