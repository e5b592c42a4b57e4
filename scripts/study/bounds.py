"""The Cramér–Rao bound over a grid of durations, ranges, tumble rates, numbers of features and baselines."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby, product
from typing import Any

import numpy as np

from baryscope import __version__
from baryscope.estimator.bound import Bound, cramer_rao_bound
from baryscope.estimator.camera.rig import Rig
from baryscope.estimator.prose import verdict
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import AnyPath
from baryscope.models.scenario import Scenario
from baryscope.progress import Progress, stage
from baryscope.study.flight import scenario_of
from baryscope.table import Table

COLUMNS = (
    "features", "baseline", "rate_deg", "range", "duration", "observations",
    "path_rmse", "com_rmse", "attitude_deg", "angular_rate_deg", "inertia_over_trace", "verdict",
)  # fmt: skip
USUAL_DURATIONS = (60.0, 120.0, 300.0, 600.0, 1200.0)  # s
USUAL_RANGES = (10.0, 20.0, 40.0, 80.0)  # m
USUAL_RATES = (0.5, 1.0, 2.0, 4.0)  # deg/s


@dataclass(frozen=True)
class Grid:
    """What is varied: durations in s, ranges in m, rates in deg/s, numbers of features, baselines in m.

    What is None stays as the scenario has it.

    Raises:
        InputError: a list is empty or has a number that is not finite and above 0.
    """

    durations: Sequence[float] | None = None
    ranges: Sequence[float] | None = None
    rates: Sequence[float] | None = None
    features: Sequence[int] | None = None
    baselines: Sequence[float] | None = None

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if values is not None and not (values and all(math.isfinite(value) and value > 0 for value in values)):
                raise InputError(f"{name}: found {list(values)}, expected numbers above 0")

    def variants(self, scenario: Scenario) -> list["Variant"]:
        """All combinations, rising, the duration varying fastest.

        Raises:
            InputError: the scenario has nothing of the kind to vary.
        """
        own = variant_of(scenario)
        if self.rates is not None and own.rate == 0:
            raise InputError("rates: found with a target that does not turn, expected an angular rate to scale")
        if self.baselines is not None and own.baseline is None:
            raise InputError("baselines: found with a scenario without sensor.stereo, expected one that has a rig")
        counts = _rising(self.features, own.features)
        if not 3 <= min(counts) <= max(counts) <= own.features:
            found = ",".join(map(str, counts))
            raise InputError(f"features: found {found}, expected 3 to the scenario's {own.features}")
        combinations = product(
            counts,
            _rising(self.baselines, own.baseline),
            _rising(self.rates, own.rate),
            _rising(self.ranges, own.range),
            _rising(self.durations, own.duration),
        )
        return [Variant(*values) for values in combinations]


def usual_grid(scenario: Scenario) -> Grid:
    """Usual durations and rates, and ranges where the noise depends on them."""
    rates = USUAL_RATES if variant_of(scenario).rate else None
    return Grid(USUAL_DURATIONS, None if scenario.sensor.stereo is None else USUAL_RANGES, rates)


def _rising(values: Sequence[Any] | None, own: Any) -> list[Any]:
    return [own] if values is None else sorted(set(values))


@dataclass(frozen=True)
class Variant:
    """How a scenario is changed: duration in s, range in m, rate in deg/s, how many features, baseline in m or None."""

    features: int
    baseline: float | None
    rate: float
    range: float
    duration: float

    def of(self, scenario: Scenario) -> Scenario:
        """The scenario so changed, checked anew.

        The range scales the chaser's position and velocity, the rate the angular velocity; the first features stay.

        Raises:
            InputError: such a scenario is not possible.
        """
        data = scenario.model_dump(mode="json", exclude_unset=True)
        own = variant_of(scenario)
        chaser, target = data["chaser"], data["target"]
        if self.range != own.range:
            for name in {"position", "velocity"} & set(chaser):
                chaser[name] = [self.range / own.range * value for value in chaser[name]]
        if self.rate != own.rate:
            target["angular_rate_deg"] = [self.rate / own.rate * value for value in target["angular_rate_deg"]]
        data.setdefault("run", {})["duration"] = self.duration
        if self.features != own.features:
            _keep_first(data, self.features)
        if self.baseline != own.baseline:
            data["sensor"]["stereo"]["baseline"] = self.baseline
        return Scenario.parse(data, f"{scenario.name}, {self.in_words()}")

    def in_words(self) -> str:
        """The variant in a line."""
        rig = "" if self.baseline is None else f", baseline {self.baseline:g} m"
        return f"{self.duration:g} s at {self.range:g} m, {self.rate:g} °/s, {self.features} features{rig}"


def _keep_first(data: dict[str, Any], count: int) -> None:
    """Drop features, and intervals in which none is left."""
    points = data["features"]["points"] = data["features"]["points"][:count]
    labels = {point["label"] for point in points}
    intervals = data.get("tracking", {}).get("intervals", [])
    for interval in intervals:
        interval["features"] = [label for label in interval["features"] if label in labels]
    left = [interval for interval in intervals if interval["features"]]
    if intervals and not left:
        raise InputError(f"features: found {count}, none of which an interval of tracking names, expected more")
    if intervals:
        data["tracking"]["intervals"] = left


def variant_of(scenario: Scenario) -> Variant:
    """The variant that a scenario is of itself."""
    rig = scenario.sensor.stereo
    return Variant(
        len(scenario.features.points),
        None if rig is None else rig.baseline,
        float(np.linalg.norm(scenario.target.angular_rate_deg)),
        float(np.linalg.norm(scenario.chaser.position)),
        scenario.duration,
    )


@dataclass(frozen=True, eq=False)
class Cell:
    """The bound of a variant, or why there is none."""

    variant: Variant
    bound: Bound | None
    reason: str = ""

    @property
    def observable(self) -> bool:
        """Whether the centre of mass can be found."""
        return self.bound is not None and bool(self.bound.observability.observable.all())

    @property
    def verdict(self) -> str:
        """In a sentence."""
        return self.reason if self.bound is None else verdict(self.bound.observability)

    @property
    def in_short(self) -> str:
        """The bound on path RMSE in mm, or why it is none, in a word."""
        if self.bound is None:
            return "none"
        if self.observable:
            return millimetres(self.bound.position_deviation)
        return "along-axis" if self.bound.observability.observable.sum() == 2 else "unobservable"

    def values(self) -> dict[str, float | int | str | None]:
        """Its row, by the names of COLUMNS: SI but for degrees; None where the centre of mass is not observable."""
        v, b = self.variant, self.bound
        row: dict[str, float | int | str | None] = dict.fromkeys(COLUMNS)
        row |= {"features": v.features, "baseline": v.baseline, "rate_deg": v.rate, "range": v.range}
        row |= {"duration": v.duration, "verdict": self.verdict}
        if b is None:
            return row
        if self.observable:
            row |= {"path_rmse": b.position_deviation, "com_rmse": b.offset_deviation}
        return row | {
            "observations": b.observations,
            "attitude_deg": float(np.rad2deg(b.attitude_deviation)),
            "angular_rate_deg": float(np.rad2deg(b.rate_deviation)),
            "inertia_over_trace": b.inertia_deviation,
        }


@dataclass(frozen=True, eq=False)
class BoundTable:
    """The bound of every variant of a scenario; trajectory: what is known of the path."""

    scenario: Scenario
    trajectory: str
    cells: tuple[Cell, ...]

    def rigs(self) -> Iterator[tuple[str, list[Cell]]]:
        """Cells of equal numbers of features and baselines, with their name."""
        for (features, baseline), group in groupby(
            self.cells, lambda cell: (cell.variant.features, cell.variant.baseline)
        ):
            yield f"{features} features" + ("" if baseline is None else f", baseline {baseline:g} m"), list(group)

    def tables(self) -> Iterator[Table]:
        """The bound on path RMSE in mm, durations down and ranges across, for each rig and rate."""
        for rig, of_rig in self.rigs():
            for rate, group in groupby(of_rig, lambda cell: cell.variant.rate):
                found = {(cell.variant.duration, cell.variant.range): cell.in_short for cell in group}
                durations, ranges = (list(dict.fromkeys(key[axis] for key in found)) for axis in (0, 1))
                rows = [(f"{t:.6g} s", *(found[t, distance] for distance in ranges)) for t in durations]
                title = f"Cramér–Rao bound on path RMSE, mm: {self.scenario.name}, {rate:.3g} °/s, {rig}"
                yield Table(("duration", *(f"{distance:g} m" for distance in ranges)), tuple(rows), title, left=0)

    def notes(self) -> list[str]:
        """What the words in the tables mean, if there are some."""
        words = {cell.in_short for cell in self.cells}
        notes = []
        if "along-axis" in words:
            notes.append("along-axis: the centre of mass is not observable along one axis")
        if "unobservable" in words:
            notes.append("unobservable: the centre of mass is not observable")
        reasons = dict.fromkeys(cell.reason for cell in self.cells if cell.bound is None)
        return notes + [f"none: {reason}" for reason in reasons]

    def to_json(self) -> dict[str, Any]:
        """Plain values: the rows as in the CSV file, by name."""
        return {
            "version": __version__,
            "scenario": self.scenario.name,
            "trajectory": self.trajectory,
            "variants": [cell.values() for cell in self.cells],
        }


def bound_table(
    scenario: Scenario | AnyPath,
    grid: Grid | None = None,
    trajectory: str | None = None,
    progress: Progress | None = None,
    *,
    process_noise: float = 0.0,
    consider: Rig | None = None,
) -> BoundTable:
    """The bound of every variant of a scenario; where some have none, the reason stands instead.

    Args:
        scenario: a scenario, a preset's name or a scenario file, FILE.toml.
        grid: what is varied; `usual_grid` unless given.
        trajectory: what is known of the path; relative-orbit unless given, see `PathOptions`.
        progress: told how far the work is.
        process_noise: density of the white acceleration beside the path's model and the thrusters' noise, m²/s³.
        consider: what is uncertain about the camera.

    Raises:
        InputError, ComputationError: none has a bound, with the first reason.
    """
    base = scenario_of(scenario)
    variants = (usual_grid(base) if grid is None else grid).variants(base)
    bound_of = partial(cramer_rao_bound, trajectory=trajectory, process_noise=process_noise, consider=consider)
    cells: list[Cell] = []
    first: ComputationError | InputError | None = None
    with stage(progress, f"bounds of {len(variants)} variants") as share:
        for count, variant in enumerate(variants, start=1):
            try:
                cells.append(Cell(variant, bound_of(variant.of(base))))
            except (ComputationError, InputError) as error:
                first = first or error
                cells.append(Cell(variant, None, str(error)))
            share(count / len(variants))
        if first is not None and all(cell.bound is None for cell in cells):
            raise first
    return BoundTable(base, path_in_words(base, trajectory, process_noise), tuple(cells))


def path_in_words(scenario: Scenario, trajectory: str | None, process_noise: float) -> str:
    """What is known of the path; process_noise: besides that of the chaser's thrusters."""
    density = process_noise + scenario.chaser.acceleration_noise
    noise = f" with process noise of {density:g} m²/s³" if density else ""
    return (trajectory or "relative-orbit") + noise


def millimetres(metres: float) -> str:
    """A length in mm with three digits."""
    return f"{1000 * metres:.3g}" if metres < 1 else f"{1000 * metres:.0f}"
