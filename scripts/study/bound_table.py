"""The Cramér–Rao bound over a grid of durations, ranges, tumble rates, numbers of features and baselines."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, product
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from baryscope.estimator.bound import Bound, cramer_rao_bound
from baryscope.estimator.prose import verdict
from baryscope.models.errors import ComputationError, InputError
from baryscope.models.files import replacing
from baryscope.models.scenario import Scenario
from baryscope.scripts.cli.console import VERSION, Report

COLUMNS = (
    "features", "baseline", "rate_deg", "range", "duration", "sightings",
    "path", "centre_of_mass", "attitude_deg", "angular_rate_deg", "inertia_over_trace", "verdict",
)  # fmt: skip
HEADINGS = (
    "features", "baseline, m", "rate, °/s", "range, m", "duration, s", "sightings",
    "path, mm", "CoM, mm", "attitude, °", "rate, °/s", "inertia", "verdict",
)  # fmt: skip


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


@dataclass(frozen=True)
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
        """The bound of the path in mm, or why it is none, in a word or two."""
        if self.bound is None:
            return "none"
        if self.observable:
            return millimetres(self.bound.position_deviation)
        return "axis hidden" if self.bound.observability.observable.sum() == 2 else "hidden"

    def values(self) -> list[float | int | str]:
        """Its row, in the order of COLUMNS: SI but for degrees; what is not observable is empty."""
        v, b = self.variant, self.bound
        place: list[float | int | str] = [v.features, v.baseline or "", v.rate, v.range, v.duration]
        if b is None:
            return [*place, "", "", "", "", "", "", self.verdict]
        of_com: list[float | str] = [b.position_deviation, b.offset_deviation] if self.observable else ["", ""]
        degrees = [float(np.rad2deg(value)) for value in (b.attitude_deviation, b.rate_deviation)]
        return [*place, b.observations, *of_com, *degrees, b.inertia_deviation, self.verdict]


def cells_of(
    scenario: Scenario, variants: Sequence[Variant], trajectory: str | None, report: Report | None = None
) -> list[Cell]:
    """The bound of each variant; where some have none, the reason stands instead.

    Raises:
        InputError, ComputationError: none has a bound, with the first reason.
    """
    cells, first = [], None
    for count, variant in enumerate(variants, start=1):
        try:
            cells.append(Cell(variant, cramer_rao_bound(variant.of(scenario), trajectory=trajectory)))
        except (ComputationError, InputError) as error:
            first = first or error
            cells.append(Cell(variant, None, str(error)))
        if report is not None:
            report(count / len(variants))
    if first is not None and all(cell.bound is None for cell in cells):
        raise first
    return cells


def grid(
    features: Sequence[int],
    baselines: Sequence[float | None],
    rates: Sequence[float],
    ranges: Sequence[float],
    durations: Sequence[float],
) -> list[Variant]:
    """All combinations, the last varying fastest."""
    return [Variant(*values) for values in product(features, baselines, rates, ranges, durations)]


def rigs_of(cells: Sequence[Cell]) -> Iterator[tuple[str, list[Cell]]]:
    """Cells of equal numbers of features and baselines, with their name."""
    for (features, baseline), group in groupby(cells, lambda cell: (cell.variant.features, cell.variant.baseline)):
        yield f"{features} features" + ("" if baseline is None else f", baseline {baseline:g} m"), list(group)


def path_tables(name: str, cells: Sequence[Cell]) -> Iterator[str | Table]:
    """For the terminal: the bound of the path in mm, durations down and ranges across, for each rig and rate."""
    for rig, of_rig in rigs_of(cells):
        for rate, group in groupby(of_rig, lambda cell: cell.variant.rate):
            found = {(cell.variant.duration, cell.variant.range): cell.in_short for cell in group}
            durations, ranges = (list(dict.fromkeys(key[axis] for key in found)) for axis in (0, 1))
            yield f"Bound of the path in mm: {name}, {rate:.3g} °/s, {rig}"
            table = Table(box=SIMPLE_HEAD, pad_edge=False)
            for heading in ("duration", *(f"{distance:g} m" for distance in ranges)):
                table.add_column(heading, justify="right")
            for duration in durations:
                table.add_row(f"{duration:.6g} s", *(found[duration, distance] for distance in ranges))
            yield table


def write_csv(cells: Sequence[Cell], path: Path) -> None:
    """Write a row for each variant."""
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(cell.values() for cell in cells)


def write_markdown(
    scenario: Scenario, trajectory: str, cells: Sequence[Cell], pictures: Sequence[Path], path: Path
) -> None:
    """Write the table with what it is of."""
    stereo = scenario.sensor.stereo is not None
    kept = [k for k in range(len(HEADINGS)) if stereo or HEADINGS[k] != "baseline, m"]
    lines = [
        f"# Cramér–Rao bound: {scenario.name}",
        "",
        f"{scenario.description}. Made by baryscope {VERSION}, for a path known to be {trajectory}, at "
        f"{1 / scenario.run.sample_time:g} Hz, {noise_of(scenario)}.",
        "Root mean squared errors that no unbiased estimate can be better than: of the path of the centre of mass over "
        "all frames, of the centre of mass (CoM), the attitude and the angular rate in the features' axes, and of the "
        "inertia over its trace.",
        "",
        *(f"![{picture.stem}]({picture.name})" for picture in pictures),
        "",
        "| " + " | ".join(HEADINGS[k] for k in kept) + " |",
        "| " + " | ".join("---" if HEADINGS[k] == "verdict" else "---:" for k in kept) + " |",
    ]
    for cell in cells:
        values = cell.values()
        for k in (6, 7):
            values[k] = millimetres(float(values[k])) if values[k] != "" else ""
        lines.append("| " + " | ".join(_shown(values[k]) for k in kept) + " |")
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def noise_of(scenario: Scenario) -> str:
    """The sensor's noise in words."""
    rig = scenario.sensor.stereo
    if rig is None:
        return f"noise {scenario.sensor.noise:g} m per axis at any range"
    return f"noise {rig.pixel_noise:g} px of a stereo rig"


def millimetres(metres: float) -> str:
    """A length in mm with three digits."""
    return f"{1000 * metres:.3g}" if metres < 1 else f"{1000 * metres:.0f}"


def _shown(value: float | int | str) -> str:
    if isinstance(value, float):
        return f"{value:.6g}" if value >= 100 else f"{value:.3g}"
    return str(value).replace("|", "/") or "-"
