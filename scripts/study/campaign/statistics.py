"""What many draws say of a method: its error against the bound, and whether it knows how good it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from baryscope.study.campaign.folder import Run
from baryscope.study.campaign.plan import Entry, Plan

FloatArray = NDArray[np.float64]

DEGREES = 3  # of freedom of an error of position
COVERAGE = 0.95
# A normalised squared error that one draw in 10 000 would have, and a path's error in units of the bound.
STRIKING_NEES = float(chi2.isf(1e-4, DEGREES))
STRIKING_RATIO = 4.0


@dataclass(frozen=True)
class Row:
    """One method in one scenario, over the draws in which it gave a result; None where it does not say.

    rms: root of the mean squared error of the path, m; own: the same as the method's covariances have it; ratio: rms
    over the bound's, with its standard error; target: the ratio that is to be reached; nees: mean at the first, middle
    and last frame, and of the CoM in the features' axes; draws, and of these failed and not converged; time: median, s.
    """

    method: str
    draws: int
    failed: int
    unsettled: int
    rms: float | None
    own: float | None
    ratio: float | None
    ratio_error: float | None
    target: float | None
    nees: tuple[float | None, ...]
    offset_nees: float | None
    time: float | None

    @property
    def reached(self) -> bool | None:
        """Whether the ratio is as small as it should be; None where nothing is asked."""
        return None if self.target is None else self.ratio is not None and self.ratio <= self.target


@dataclass(frozen=True)
class Striking:
    """A draw that deserves a look."""

    scenario: str
    case: int
    method: str
    what: str


def rows_of(entry: Entry, plan: Plan, runs: Mapping[tuple[str, int], Run]) -> list[Row]:
    """A row for each method of a scenario."""
    own = _of_scenario(entry, runs)
    return [_row(method, own, entry.targets.get(method.removesuffix("-lvlh"))) for method in plan.methods]


def bound_of(entry: Entry, runs: Mapping[tuple[str, int], Run]) -> tuple[float | None, float | None]:
    """Root mean square over the draws, m, of the bound of the path without outliers, and with them."""
    bounds = [run["bound"] for run in _of_scenario(entry, runs) if "path" in run["bound"]]
    return _root_mean_square([one["reference"] for one in bounds]), _root_mean_square([one["path"] for one in bounds])


def nees_band(draws: int) -> tuple[float, float]:
    """Between which the mean of so many NEES of three degrees of freedom is, in 95 of 100 campaigns."""
    tail = (1 - COVERAGE) / 2
    low, high = chi2.ppf([tail, 1 - tail], DEGREES * draws) / draws
    return float(low), float(high)


def striking(plan: Plan, runs: Mapping[tuple[str, int], Run]) -> list[Striking]:
    """Draws that failed, did not converge, or are off by more than chance allows; of methods that have covariances."""
    found = []
    for run in (runs[key] for key in sorted(runs)):
        name, case = run["scenario"], run["case"]
        if "failure" in run["bound"]:
            found.append(Striking(name, case, "bound", run["bound"]["failure"]))
        for text in run.get("warnings", []):
            found.append(Striking(name, case, "all", f"warning: {text}"))
        for method in plan.methods:
            what = _what_strikes(run["methods"][method], run["bound"].get("reference"))
            if what:
                found.append(Striking(name, case, method, what))
    return found


def _what_strikes(outcome: dict[str, Any], bound: float | None) -> str:
    if "failure" in outcome:
        return f"failed: {outcome['failure']}"
    if outcome["own"] is None:
        return ""
    notes = [] if outcome["converged"] in (True, None) else ["did not converge"]
    if bound and outcome["rms"] > STRIKING_RATIO * bound:
        notes.append(f"{outcome['rms'] / bound:.1f} × bound")
    nees = [value for value in outcome["nees"] or () if value is not None]
    if nees and max(nees) > STRIKING_NEES:
        notes.append(f"NEES {' '.join(f'{value:.0f}' for value in nees)}")
    offset = outcome.get("offset_nees")
    if offset is not None and offset > STRIKING_NEES:
        notes.append(f"NEES {offset:.0f} in features' axes")
    return ", ".join(notes)


def _of_scenario(entry: Entry, runs: Mapping[tuple[str, int], Run]) -> list[Run]:
    return [runs[key] for key in sorted(runs) if key[0] == entry.name]


def _row(method: str, runs: Sequence[Run], target: float | None) -> Row:
    good = [run for run in runs if "failure" not in run["methods"][method]]
    outcomes = [run["methods"][method] for run in good]
    ratio, error = _ratio(
        [(run["methods"][method]["rms"], run["bound"]["reference"]) for run in good if "path" in run["bound"]]
    )
    normalised = [one["nees"] for one in outcomes if one["nees"] is not None]
    times = [run["wall"][method] for run in good if method in run["wall"]]
    return Row(
        method=method,
        draws=len(runs),
        failed=len(runs) - len(good),
        unsettled=sum(one["converged"] is False for one in outcomes),
        rms=_root_mean_square([one["rms"] for one in outcomes]),
        own=_root_mean_square([one["own"] for one in outcomes if one["own"] is not None]),
        ratio=ratio,
        ratio_error=error,
        target=target,
        nees=tuple(_mean([one[k] for one in normalised if one[k] is not None]) for k in range(3)),
        offset_nees=_mean([one["offset_nees"] for one in outcomes if one.get("offset_nees") is not None]),
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
