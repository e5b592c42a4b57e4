"""Comparisons: one flight, estimated by several methods, against the truth and the Cramér–Rao bound."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope import __version__
from baryscope.estimator.bound import Bound, cramer_rao_bound
from baryscope.estimator.methods import METHODS, Failure, attempt
from baryscope.estimator.progress import silent
from baryscope.estimator.result import Estimate
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario import Scenario
from baryscope.models.words import brief, counted
from baryscope.progress import Progress, Share, stage
from baryscope.study.flight import Flight, fly
from baryscope.study.methods import axes_of, labels_of, options_of
from baryscope.table import Table

FloatArray = NDArray[np.float64]

HEADINGS = ("method", "axes or path", "RMSE, mm", "max, mm", "predicted RMSE, mm", "coverage", "time")
COVERED = 0.1  # median of the difference of the errors' logarithms, below which one curve covers the other
LEAST = 1e-12  # m, below which errors are alike


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method makes of the tracks.

    Attributes:
        label: the method's name, with -lvlh at its end if it registers in LVLH axes; the stem of its files.
        estimate: the result; None where the method cannot be carried out.
        error: (n,), distance from the true centre of mass at every time, m.
        failure: why there is no result.
    """

    label: str
    estimate: Estimate | None = None
    error: FloatArray | None = None
    failure: str = ""

    __repr__ = brief

    @property
    def method(self) -> str:
        """Its name in the list of methods."""
        return options_of(self.label)[0]

    @property
    def axes(self) -> str:
        """Axes of registration, or the kind of path that is assumed; - where there is no result."""
        if (axes := axes_of(self.label)) is not None:
            return axes
        return "-" if self.estimate is None else self.estimate.path

    @property
    def title(self) -> str:
        """The method and its axes, in words."""
        return f"{self.method}, {self.axes}" + (" axes" if axes_of(self.label) else "")

    @property
    def rmse(self) -> float | None:
        """Root mean squared error of the path over all frames, m."""
        return None if self.error is None else float(np.sqrt(np.mean(self.error**2)))

    @property
    def max_error(self) -> float | None:
        """Largest error of the path, m."""
        return None if self.error is None else float(self.error.max())

    @property
    def predicted_rmse(self) -> float | None:
        """The RMSE that the method's covariance predicts, m."""
        return None if self.estimate is None else self.estimate.predicted_rmse

    @property
    def coverage(self) -> float | None:
        """Share of the frames at which the method has an attitude to go by."""
        return None if self.estimate is None else self.estimate.coverage

    @property
    def doubt(self) -> str:
        """The status of an estimate that announces itself as not to be trusted; else nothing."""
        return "" if self.estimate is None or self.estimate.status.trustworthy else str(self.estimate.status)

    @property
    def wall_time(self) -> float | None:
        """How long the estimate took, s."""
        return None if self.estimate is None else self.estimate.wall_time


@dataclass(frozen=True, eq=False)
class Comparison:
    """One flight and what every method makes of it.

    Attributes:
        flight: what is flown, the truth and the tracks.
        outcomes: one for each method, screw-gpa having two.
        bound: the Cramér–Rao bound of the scenario; None where it has none.
        no_bound: why it has none.
    """

    flight: Flight
    outcomes: tuple[Outcome, ...]
    bound: Bound | None
    no_bound: str = ""

    def __repr__(self) -> str:
        """What was flown, and by which methods; `table` has what came of it."""
        return f"<Comparison of {', '.join(one.label for one in self.outcomes)}: {self.flight!r}>"

    def __getitem__(self, label: str) -> Outcome:
        """The outcome of a method, by label."""
        for outcome in self.outcomes:
            if outcome.label == label:
                return outcome
        raise InputError(f"{label}: not compared, expected one of {', '.join(one.label for one in self.outcomes)}")

    def hidden(self, outcome: Outcome) -> bool:
        """Whether the curve of its error lies below that of a later outcome, so that it would not be seen."""
        if outcome.error is None:
            return False
        later = [one.error for one in self.outcomes[self.outcomes.index(outcome) + 1 :] if one.error is not None]
        mine = np.log(np.maximum(outcome.error, LEAST))
        return any(np.median(np.abs(np.log(np.maximum(error, LEAST)) - mine)) < COVERED for error in later)

    @property
    def scenario(self) -> Scenario:
        """What is flown."""
        return self.flight.scenario

    @cached_property
    def bound_max(self) -> float | None:
        """The largest of the bound's deviations over time, m."""
        if self.bound is None:
            return None
        return float(np.sqrt(np.trace(self.bound.position_covariance, axis1=1, axis2=2).max()))

    @property
    def doubts(self) -> str:
        """Which methods announce that they are not to be trusted, in a sentence; nothing if none does."""
        doubtful = [f"{one.label} ({one.doubt})" for one in self.outcomes if one.doubt]
        return f"Not to be trusted, as they say themselves: {', '.join(doubtful)}." if doubtful else ""

    def table(self) -> Table:
        """A row for each method, the bound's last; a notebook shows it as a table."""
        rows = [_cells(outcome) for outcome in self.outcomes]
        if self.bound is not None:
            path = (_millimetres(self.bound.position_deviation), _millimetres(self.bound_max))
            rows.append(("Cramér–Rao bound", "relative-orbit", *path, "-", "-", "-"))
        title = f"Error of the centre of mass, {self.scenario.name}, {self.scenario.duration:.0f} s"
        return Table(HEADINGS, tuple(rows), title, left=2)

    def to_json(self) -> dict[str, Any]:
        """The numbers of the table as plain values: m, s and shares; null where there is none."""
        return {
            "version": __version__,
            "scenario": self.scenario.name,
            "frames": self.flight.tracks.time.size,
            "duration": self.scenario.duration,
            "seed": self.scenario.run.seed,
            "methods": [
                {
                    "label": outcome.label,
                    "method": outcome.method,
                    "axes": outcome.axes,
                    "rmse": outcome.rmse,
                    "max_error": outcome.max_error,
                    "predicted_rmse": outcome.predicted_rmse,
                    "coverage": outcome.coverage,
                    "wall_time": outcome.wall_time,
                    "status": None if outcome.estimate is None else str(outcome.estimate.status),
                    "failure": outcome.failure or None,
                }
                for outcome in self.outcomes
            ],
            "cramer_rao_bound": None
            if self.bound is None
            else {"rmse": self.bound.position_deviation, "max_error": self.bound_max},
        }


def compare(
    scenario: Scenario | AnyPath = "envisat",
    methods: Sequence[str] | None = None,
    *,
    unit: AnyPath | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Fly a scenario, estimate with every method, and compare with the truth.

    Args:
        scenario: a scenario, a preset's name or a scenario file, FILE.toml.
        methods: names out of `METHODS`, all unless given; screw-gpa runs in inertial and in LVLH axes.
        unit: an FMU built for as many features; built on the spot unless given.
        progress: told how far the work is.

    Returns:
        The comparison. A method that cannot be carried out has an outcome that says why.

    Raises:
        InputError: no such scenario or method, or a unit that does not fit.
        ComputationError: the unit cannot be built or stepped.
    """
    labels = labels_of(list(METHODS) if methods is None else methods)
    flight = fly(scenario, unit, progress)
    outcomes = []
    with stage(progress, f"estimating by {counted(len(labels), 'method')}") as share:
        for label in labels:
            with stage(progress, f"estimating by {label}") as share_of_one:
                outcomes.append(judge(label, flight, share_of_one))
            share(len(outcomes) / len(labels))
    bound, no_bound = None, ""
    with stage(progress, "Cramér–Rao bound"):
        try:
            bound = cramer_rao_bound(flight.scenario)
        except (ComputationError, InputError) as reason:
            no_bound = str(reason)
    return Comparison(flight, tuple(outcomes), bound, no_bound)


def judge(label: str, flight: Flight, progress: Share = silent) -> Outcome:
    """Estimate by the method of a label, and measure its error."""
    method, options = options_of(label)
    orbit = flight.scenario.orbit.of_simulation()
    result = attempt(flight.tracks, method=method, orbit=orbit, options=options, progress=progress)
    if isinstance(result, Failure):
        return Outcome(label, failure=result.message)
    return Outcome(label, result, np.linalg.norm(result.position - flight.true_path, axis=1))


def _cells(outcome: Outcome) -> tuple[str, ...]:
    if outcome.coverage is None or outcome.wall_time is None:
        return (outcome.method, outcome.axes, "-", "-", "-", "-", "-")
    return (
        outcome.method,
        outcome.axes,
        _millimetres(outcome.rmse),
        _millimetres(outcome.max_error),
        _millimetres(outcome.predicted_rmse),
        f"{100 * outcome.coverage:.0f} %",
        f"{outcome.wall_time:.2f} s",
    )


def _millimetres(metres: float | None) -> str:
    return "-" if metres is None else f"{1000 * metres:.2f}"
