"""The picture of one method's outcome: the path, axis by axis, and the error over time."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.bound import Bound
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.files import replacing
from baryscope.models.scenario import Scenario
from baryscope.scripts.cli.console import err
from baryscope.study.report import Outcome

_INK, _ESTIMATE, _SHADE = "#333333", "#d1495b", "#e9e9ee"
_COLOURS = ("#b9b9c3", "#8d99ae", "#e09f3e", "#9e2a2b", "#2a9d8f", "#264ee4", "#8e5bd0", "#c77dbb")


@cache
def pictures_possible() -> bool:
    """Whether matplotlib is there; says once what to install if it is not."""
    if find_spec("matplotlib") is not None:
        return True
    err.print("no pictures: they need matplotlib (pip install 'baryscope[report]')", soft_wrap=True)
    return False


def draw_outcome(
    scenario: Scenario, tracks: FeatureTracks, true_path: NDArray[np.float64], outcome: Outcome, path: Path
) -> None:
    """Draw the true and the estimated path in C and the error on a logarithmic scale; blackouts are shaded."""
    from matplotlib.figure import Figure

    if outcome.estimate is None or outcome.error is None:
        return
    time = tracks.time
    figure = Figure(figsize=(9, 7.5), dpi=120, layout="constrained")
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(1, 1, 1, 1.6))
    for axis, (panel, name) in enumerate(zip(panels[:3], "xyz", strict=True)):
        panel.plot(time, true_path[:, axis], color=_INK, lw=2.5, label="truth")
        panel.plot(time, outcome.estimate.position[:, axis], color=_ESTIMATE, lw=1, label="estimate")
        panel.set_ylabel(f"{name} in m")
    rms = np.sqrt(np.mean(outcome.error**2))
    panels[3].semilogy(time, np.maximum(outcome.error, 1e-9), color=_ESTIMATE, lw=1)
    panels[3].axhline(rms, color=_INK, lw=0.8, ls="--", label=f"rms {rms:.3g} m")
    panels[3].set_ylabel("error in m")
    panels[3].set_xlabel("time in s")
    panels[3].legend(loc="upper right")
    for panel in panels:
        _shade_blackouts(panel, time, np.any(tracks.seen, axis=1))
        panel.set_xlim(time[0], time[-1])
        panel.grid(alpha=0.25)
    panels[0].legend(loc="upper right", ncols=3)
    figure.suptitle(f"{scenario.name}: centre of mass by {outcome.title} (frame C; blackouts shaded)")
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def draw_comparison(
    scenario: Scenario, tracks: FeatureTracks, outcomes: list[Outcome], bound: Bound | None, path: Path
) -> None:
    """Draw the errors of all methods over time on a logarithmic scale, the bound among them; blackouts are shaded."""
    from matplotlib.figure import Figure

    time = tracks.time
    figure = Figure(figsize=(9, 5), dpi=120, layout="constrained")
    panel = figure.subplots()
    for outcome, colour in zip(outcomes, _COLOURS, strict=False):
        if outcome.error is not None:
            rms = np.sqrt(np.mean(outcome.error**2))
            panel.semilogy(time, outcome.error, color=colour, lw=1, label=f"{outcome.title}: {_length(rms)} rms")
    if bound is not None:
        least = np.sqrt(np.trace(bound.position_covariance, axis1=1, axis2=2))
        label = f"Cramér–Rao bound: {_length(bound.position_deviation)} rms"
        panel.semilogy(bound.time, least, color=_INK, lw=2, ls="--", label=label)
    _shade_blackouts(panel, time, np.any(tracks.seen, axis=1))
    panel.set_xlim(time[0], time[-1])
    low, high = panel.get_ylim()
    panel.set_ylim(max(low, 1e-5), high)
    panel.set_xlabel("time in s")
    panel.set_ylabel("error of the centre of mass in m")
    panel.grid(alpha=0.25)
    panel.legend(loc="center", bbox_to_anchor=(0.5, 0.72), ncols=2, fontsize=8)
    panel.set_title(f"{scenario.name}: {scenario.description}", fontsize=10)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": None})


def _length(metres: float) -> str:
    return f"{metres:.2f} m" if metres >= 0.1 else f"{1000 * metres:.2f} mm"


def _shade_blackouts(panel: Any, time: NDArray[np.float64], seen: NDArray[np.bool_]) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[True], seen, [True]]).astype(int)))
    for k, (start, stop) in enumerate(edges.reshape(-1, 2)):
        end = time[min(stop, time.size - 1)]
        panel.axvspan(time[start], end, color=_SHADE, lw=0, label="nothing seen" if k == 0 else None)
