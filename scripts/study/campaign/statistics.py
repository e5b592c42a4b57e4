"""What many draws say of a method: its error against the bound, and whether it knows how good it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from baryscope.study.campaign.folder import Run
from baryscope.study.campaign.plan import Plan
from baryscope.study.campaign.suite import Entry
from baryscope.study.methods import LVLH

FloatArray = NDArray[np.float64]

DEGREES = 3  # of freedom of an error of position
COVERAGE = 0.95
# A normalised squared error that one draw in 10 000 would have, and a path's error in units of the bound.
LARGE_NEES = float(chi2.isf(1e-4, DEGREES))
LARGE_RATIO = 4.0


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


def rows_of(entry: Entry, plan: Plan, runs: Mapping[tuple[str, int], Run]) -> list[Row]:
    """A row for each method of a scenario."""
    of_scenario = _of_scenario(entry, runs)
    return [_row(method, of_scenario, entry.targets.get(method.removesuffix(LVLH))) for method in plan.methods]


def bound_of(entry: Entry, runs: Mapping[tuple[str, int], Run]) -> tuple[float | None, float | None]:
    """Root mean square over the draws, m, of the bound of the path without outliers, and with them."""
    bounds = [run["bound"] for run in _of_scenario(entry, runs) if "path_rmse" in run["bound"]]
    clean, found = ([one[name] for one in bounds] for name in ("path_rmse_clean", "path_rmse"))
    return _root_mean_square(clean), _root_mean_square(found)


def nees_band(draws: int) -> tuple[float, float]:
    """Between which the mean of so many NEES of three degrees of freedom is, in 95 of 100 campaigns."""
    tail = (1 - COVERAGE) / 2
    low, high = chi2.ppf([tail, 1 - tail], DEGREES * draws) / draws
    return float(low), float(high)


def remarks(plan: Plan, runs: Mapping[tuple[str, int], Run]) -> list[Remark]:
    """Draws that failed, were announced, or are off by more than chance allows; of methods that have covariances."""
    found = []
    for run in (runs[key] for key in sorted(runs)):
        name, case = run["scenario"], run["case"]
        if "failure" in run["bound"]:
            found.append(Remark(name, case, "bound", run["bound"]["failure"]))
        for text in run.get("warnings", []):
            found.append(Remark(name, case, "all", f"warning: {text}"))
        for method in plan.methods:
            text = _about(run["methods"][method], run["bound"].get("path_rmse_clean"))
            if text:
                found.append(Remark(name, case, method, text))
    return found


def _about(outcome: dict[str, Any], bound: float | None) -> str:
    if "failure" in outcome:
        return f"failed: {outcome['failure']}"
    if outcome["predicted_rmse"] is None:
        return ""
    notes = [] if outcome["trustworthy"] in (True, None) else ["was announced"]
    if bound and outcome["rmse"] > LARGE_RATIO * bound:
        notes.append(f"{outcome['rmse'] / bound:.1f} × CRB")
    nees = [value for value in outcome["nees"] or () if value is not None]
    if nees and max(nees) > LARGE_NEES:
        notes.append(f"NEES {' '.join(f'{value:.0f}' for value in nees)}")
    in_body = outcome.get("body_nees")
    if in_body is not None and in_body > LARGE_NEES:
        notes.append(f"NEES {in_body:.0f} in body axes")
    return ", ".join(notes)


def _of_scenario(entry: Entry, runs: Mapping[tuple[str, int], Run]) -> list[Run]:
    return [runs[key] for key in sorted(runs) if key[0] == entry.name]


def _row(method: str, runs: Sequence[Run], target: float | None) -> Row:
    good = [run for run in runs if "failure" not in run["methods"][method]]
    outcomes = [run["methods"][method] for run in good]
    ratio, error = _ratio(
        [
            (run["methods"][method]["rmse"], run["bound"]["path_rmse_clean"])
            for run in good
            if "path_rmse" in run["bound"]
        ]
    )
    normalised = [one["nees"] for one in outcomes if one["nees"] is not None]
    times = [run["wall"][method] for run in good if method in run["wall"]]
    return Row(
        method=method,
        draws=len(runs),
        failed=len(runs) - len(good),
        announced=sum(one["trustworthy"] is False for one in outcomes),
        rmse=_root_mean_square([one["rmse"] for one in outcomes]),
        predicted_rmse=_root_mean_square(
            [one["predicted_rmse"] for one in outcomes if one["predicted_rmse"] is not None]
        ),
        ratio=ratio,
        ratio_error=error,
        target=target,
        nees=tuple(_mean([one[k] for one in normalised if one[k] is not None]) for k in range(3)),
        body_nees=_mean([one["body_nees"] for one in outcomes if one.get("body_nees") is not None]),
        time=float(np.median(times)) if times else None,
    )


def _ratio(pairs: Sequence[tuple[float, float]]) -> tuple[float | None, float | None]:
    """√(mean e² / mean b²) of pairs (e, b), and its standard error to first order (that of a ratio of two means)."""
    if not pairs:
        return None, None
    e, b = np.array(pairs).T ** 2
    ratio = float(np.sqrt(e.mean() / b.mean()))
    if len(pairs) < 2 or ratio == 0:
        return ratio, None
    deviation = np.std(e - ratio**2 * b, ddof=1) / np.sqrt(len(pairs)) / b.mean()
    return ratio, float(deviation / (2 * ratio))


def _root_mean_square(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None
