"""An estimate as files: the path as CSV, and everything else as JSON with a documented, versioned schema.

The schema is derived from `EstimateDocument` by pydantic; a test compares docs/estimate.schema.json with it.
"""

import csv
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np
from pydantic import Field

from baryscope.estimator.document_details import (
    DetailsPart,
    Matrix,
    Part,
    Vector,
    details_part,
    plain,
)
from baryscope.estimator.findings import Finding
from baryscope.estimator.formats.write import netcdf, parquet, zarr
from baryscope.estimator.observability import Observability, PrincipalAxes
from baryscope.estimator.prediction import Prediction
from baryscope.estimator.prose import sentence, verdict
from baryscope.estimator.registration.intervals import runs_of
from baryscope.estimator.result import Cluster, Estimate, ProcessNoise, Status
from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS, UPPER
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, Writer, write_together

SCHEMA_VERSION: Literal[1] = 1

Interval = tuple[float, float]
STATE = ("x", "y", "z", "vx", "vy", "vz")


class AxesPart(Part):
    """Principal axes of a covariance."""

    deviations: Vector = Field(description="standard deviations, ascending, m")
    directions: Matrix = Field(description="a unit vector a row, one for each deviation")


class ObservabilityPart(Part):
    """Observability of the centre of mass."""

    verdict: str = Field(description="in words; not to be parsed")
    cluster: int = Field(description="index of the cluster whose axes `body` refers to: that of most frames")
    threshold: float = Field(description="standard deviation above which a direction is not observable, m")
    observable: tuple[bool, bool, bool] = Field(description="for each direction of `body`")
    condition_number: float | None = Field(description="greatest over least variance in body axes")
    body: AxesPart = Field(description="of the centre of mass in the cluster's axes")
    inertial: AxesPart = Field(description="of the path in C, mean over all times")


class NoisePart(Part):
    """Standard deviation of an observation's coordinate."""

    a_priori: float | None = Field(description="as given with --sigma")
    a_posteriori: float = Field(description="from the residuals")
    unit: Literal["m", "1"] = Field(description="1: a factor on the standard deviations given with the tracks")
    lasting: float = Field(description="how many successive frames have the same error of a feature; 1 for white noise")


class ClusterPart(Part):
    """A rigid cluster of features."""

    start: float = Field(description="first time with an attitude, s")
    end: float = Field(description="last time with an attitude, s")
    frames: int = Field(description="number of frames with an attitude")
    intervals: tuple[Interval, ...] = Field(description="begin and end of the periods in which it is tracked, s")
    features: dict[str, Vector] = Field(description="points in cluster axes from their centroid, m")
    centre_of_mass: Vector | None = Field(description="in the same axes, from the centroid, m")
    centre_of_mass_covariance: Matrix | None = Field(description="m², in axes attached to the points")


class RejectedPart(Part):
    """Rejected observations."""

    share: float = Field(description="of the used observations")
    features: tuple[str, ...] = Field(description="features with most of their observations rejected")
    intervals: dict[str, tuple[Interval, ...]] = Field(description="for each feature, from first to last time, s")


class ForcePart(Part):
    """An estimated factor of a force, or an error of the camera."""

    name: str = Field(
        description="acceleration scale (its relative error), constant acceleration, error of the orbit, or of the "
        "camera: boresight, scale (relative), lever arm"
    )
    value: float
    deviation: float = Field(description="standard deviation")
    unit: Literal["1", "m/s²", "m", "rad"]


class ProcessNoisePart(Part):
    """White acceleration on the path beside its model."""

    source: Literal["estimated", "given", "none"]
    density: float = Field(description="0 for none, in `unit`")
    unit: Literal["m²/s³", "m²"] = Field(description="m²: variance of white noise of a fixed path's position")
    bounds: Interval | None = Field(description="of an estimated density, that hold 90 %")
    significance: float | None = Field(description="2 ln of the likelihood over that without noise")
    displacement: float | None = Field(description="rms displacement by it, less what the path's model could do, m")


class FindingPart(Part):
    """Evidence against a model."""

    kind: Literal[
        "lack-of-fit",
        "excess-residuals",
        "frames-left-out",
        "few-frames",
        "follows-rotation",
        "extrapolated",
        "different-points",
        "departure",
        "wrong-orbit",
        "estimated-orbit",
        "untold-oblateness",
        "untold-accuracy",
        "unknown-burn",
        "wrong-sigma",
        "changing-noise",
        "depth-noise",
        "free-attitudes",
    ]
    text: str = Field(description="in words; not to be parsed")
    path: str | None = Field(None, description="lack-of-fit, departure: the path's model")
    magnitude: float | None = Field(None, description="departure of the path, m: rms, or median of the frames left out")
    chi_square: float | None = Field(
        None,
        description="lack-of-fit: decrease of the normalised squares by a cubic in time, by score of degree 4",
    )
    dof: int | None = Field(None, description="lack-of-fit: expectation of chi_square for a right model")
    model: str | None = Field(None, description="excess-residuals: the path's model, or free tumble")
    ratio: float | None = Field(None, description="excess-residuals: residuals with the model over those without")
    frames: int | None = Field(None, description="frames-left-out, few-frames: their number")
    unknowns: float | None = Field(
        None, description="few-frames, follows-rotation: of path, offsets and tumble, or path, that are determined"
    )
    labels: tuple[str, ...] | None = Field(None, description="different-points: labels of different points")
    clusters: tuple[int, int] | None = Field(None, description="different-points: indices of the two clusters")
    density: float | None = Field(None, description="departure: of the process noise that explains it, m²/s³")
    significance: float | None = Field(None, description="departure: 2 ln of the likelihood over that without noise")
    share: float | None = Field(
        None, description="follows-rotation: of the information on the offset, that noise of the attitudes feigns"
    )
    shift: Vector | None = Field(None, description="wrong-orbit: of the target from its orbit, LVLH, mid-time, m")
    deviation: Vector | None = Field(None, description="wrong-orbit: standard deviation of shift, m")
    oblate: bool | None = Field(None, description="wrong-orbit: whether the orbit has J2, which else may look like it")
    period: float | None = Field(None, description="estimated-orbit: of the target, s")
    period_deviation: float | None = Field(None, description="estimated-orbit: its standard deviation, s")
    eccentricity: float | None = Field(None, description="estimated-orbit: of the target's orbit")
    eccentricity_deviation: float | None = Field(None, description="estimated-orbit: its standard deviation")
    j2: float | None = Field(None, description="untold-oblateness: of the Earth, which the estimate has, or allows for")
    certain: bool | None = Field(None, description="untold-oblateness: whether the tracks are likelier with J2")
    begin: float | None = Field(None, description="unknown-burn, frames-left-out, extrapolated: begin, s")
    begin_deviation: float | None = Field(None, description="unknown-burn: its standard deviation, s")
    end: float | None = Field(None, description="unknown-burn, frames-left-out, extrapolated: end, s")
    end_deviation: float | None = Field(None, description="unknown-burn: its standard deviation, s")
    change: Vector | None = Field(None, description="unknown-burn: of the chaser's velocity, m/s")
    change_deviation: Vector | None = Field(None, description="unknown-burn: standard deviation of change, m/s")
    axes: Literal["lvlh", "inertial"] | None = Field(None, description="unknown-burn: axes of change")
    place: float | None = Field(None, description="untold-accuracy: standard deviation of the orbit, m")
    push: float | None = Field(None, description="untold-accuracy: standard deviation of a constant acceleration, m/s²")
    given: float | None = Field(None, description="wrong-sigma: a priori, m or a factor as sigma")
    found: float | None = Field(None, description="wrong-sigma: from the bodies alone, in the same unit")
    begins: tuple[float, ...] | None = Field(None, description="changing-noise: begins of the parts, s")
    deviations: tuple[float, ...] | None = Field(None, description="changing-noise: of a coordinate in each part, m")
    across: float | None = Field(None, description="depth-noise: deviation of a coordinate across the line of sight, m")
    along: float | None = Field(None, description="depth-noise: the same along it, m")
    reason: str | None = Field(
        None, description="free-attitudes: why ml or ekf tells no tumble, in words; not to be parsed"
    )


class EstimateDocument(Part):
    """The JSON file that `baryscope estimate` writes beside the path of the centre of mass."""

    schema_version: Literal[1] = SCHEMA_VERSION
    version: str = Field(description="of baryscope")
    epoch: str | None = Field(description="UTC of time 0; null if it is not known")
    method: str
    status: Status = Field(description="whether the estimate can be used")
    path: str = Field(description="the path's model: fixed, polynomial:N, relative-orbit, fixed in LVLH")
    options: dict[str, str | float | int | None] = Field(description="as given or chosen; null: not given, not needed")
    converged: bool
    rounds: int
    coverage: float = Field(description="share of the times at which the tracks determine an attitude")
    predicted_rmse: float | None = Field(description="of the path, from its covariance, m")
    noise: NoisePart
    process_noise: ProcessNoisePart | None = Field(description="null if the method has no model of it")
    observability: ObservabilityPart | None
    clusters: tuple[ClusterPart, ...]
    residual_rms: dict[str, float | None] = Field(description="of each feature, per coordinate, m")
    rejected: RejectedPart
    forces: tuple[ForcePart, ...] = Field(description="estimated factors of forces, and errors of the camera")
    findings: tuple[FindingPart, ...]
    details: DetailsPart
    wall_time: float = Field(description="s")


def document_of(result: Estimate) -> EstimateDocument:
    """The document of an estimate: everything except its series over time."""
    return EstimateDocument(
        version=result.version,
        epoch=result.epoch,
        method=result.method,
        status=result.status,
        path=result.path,
        options={field.name: _option(getattr(result.options, field.name)) for field in fields(result.options)},
        converged=result.converged,
        rounds=result.rounds,
        coverage=result.coverage,
        predicted_rmse=plain(result.predicted_rmse),
        noise=NoisePart(
            a_priori=result.noise.a_priori,
            a_posteriori=result.noise.a_posteriori,
            unit="1" if result.noise.relative else "m",
            lasting=result.noise.lasting,
        ),
        process_noise=None if result.process_noise is None else _process_noise(result.process_noise),
        observability=None if result.observability is None else _observability(result.observability),
        clusters=tuple(_cluster(cluster, result) for cluster in result.clusters),
        residual_rms={
            label: plain(value) for label, value in zip(result.labels, result.feature_rms.tolist(), strict=True)
        },
        rejected=RejectedPart(
            share=result.rejected_share, features=result.rejected_features, intervals=rejected_intervals(result)
        ),
        forces=tuple(ForcePart.model_validate(asdict(force)) for force in result.forces),
        findings=tuple(_finding(finding) for finding in result.findings),
        details=details_part(result.details),
        wall_time=result.wall_time,
    )


def schema() -> dict[str, Any]:
    """The JSON schema of the document."""
    return EstimateDocument.model_json_schema(mode="serialization")


def schema_text() -> str:
    """The JSON schema as the text of docs/estimate.schema.json."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"


def write_estimate(
    result: Estimate, path: AnyPath, prediction: Prediction | None = None, also: Mapping[Path, str] | None = None
) -> None:
    """Write the path as a CSV file, and the document beside it with the suffix .json.

    A name that ends in .parquet has the same columns in Parquet, and one in .nc or .zarr has
    `Estimate.to_dataset` in NetCDF or Zarr.
    prediction: goes into a file with the suffix .prediction.csv; also: texts of other files, to be written with these
    or, if one cannot be, not at all.

    Raises:
        InputError: a file cannot be written, or the two names are one.
    """
    path = Path(path)
    beside = path.with_suffix(".json")
    if beside == path:
        raise InputError(f"{path}: this name is kept for the diagnostics, expected another suffix than .json")
    text = json.dumps(document_of(result).model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False)
    writing: dict[Path, Writer] = {path: _path_writer(result, path), beside: lambda stream: stream.write(text + "\n")}
    if prediction is not None:
        names = ("time", *STATE, *(f"c{one}{other}" for k, one in enumerate(STATE) for other in STATE[k:]))
        writing[path.with_suffix(".prediction.csv")] = _rows(names, _predicted_columns(prediction))
    texts = (also or {}).items()
    write_together(writing | {file: partial(_write_text, content) for file, content in texts})


def _path_writer(result: Estimate, path: Path) -> Writer:
    names = ("time", "x", "y", "z", *COVARIANCE_COLUMNS)
    match path.suffix:
        case ".parquet":
            return parquet(dict(zip(names, _columns(result), strict=True)))
        case ".nc":
            return netcdf(result.to_dataset())
        case ".zarr":
            return zarr(result.to_dataset())
    return _rows(names, _columns(result))


def _write_text(content: str, stream: TextIO) -> None:
    stream.write(content)


def _columns(result: Estimate) -> list[list[object]]:
    """Time, position and covariance, whose cells are empty if there is none."""
    n = len(result.time)
    columns: list[list[object]] = [result.time.tolist(), *(result.position[:, axis].tolist() for axis in range(3))]
    for row, column in UPPER:
        columns.append([None] * n if result.covariance is None else result.covariance[:, row, column].tolist())
    return columns


def _predicted_columns(found: Prediction) -> list[list[object]]:
    """Time, position, velocity, and the upper triangle of their covariance, row by row."""
    states = [values[:, axis].tolist() for values in (found.position, found.velocity) for axis in range(3)]
    rows, columns = np.triu_indices(6)
    covariance = found.covariance[:, rows, columns].T.tolist()
    return [found.time.tolist(), *states, *covariance]


def _rows(names: tuple[str, ...], columns: list[list[object]]) -> Callable[[TextIO], None]:
    """What writes columns as a CSV file."""

    def write(stream: TextIO) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))

    return write


def _option(value: Any) -> Any:
    """An option as JSON has it, a known acceleration in words."""
    return str(value) if isinstance(value, KnownAcceleration) else plain(value)


def _axes(axes: PrincipalAxes) -> AxesPart:
    return AxesPart(deviations=plain(axes.deviations), directions=plain(axes.directions))


def _observability(found: Observability) -> ObservabilityPart:
    first, second, third = found.observable.tolist()
    return ObservabilityPart(
        verdict=verdict(found),
        cluster=found.cluster,
        threshold=found.threshold,
        observable=(first, second, third),
        condition_number=plain(found.condition_number),
        body=_axes(found.body),
        inertial=_axes(found.inertial),
    )


def _cluster(cluster: Cluster, result: Estimate) -> ClusterPart:
    time = result.time
    return ClusterPart(
        start=float(time[cluster.frames[0]]),
        end=float(time[cluster.frames[-1]]),
        frames=len(cluster.frames),
        intervals=tuple((float(time[one.start]), float(time[one.stop - 1])) for one in cluster.intervals),
        features={
            label: plain(point)
            for label, point in zip(cluster.labels, cluster.points, strict=True)
            if np.isfinite(point).all()
        },
        centre_of_mass=plain(cluster.centre_of_mass) if np.isfinite(cluster.centre_of_mass).all() else None,
        centre_of_mass_covariance=plain(cluster.covariance),
    )


def rejected_intervals(result: Estimate) -> dict[str, tuple[Interval, ...]]:
    """For each feature with rejected observations, their intervals from first to last time, s."""
    found = {}
    for index in np.nonzero(result.rejected.any(axis=0))[0]:
        runs = runs_of(result.rejected[:, index])
        found[result.labels[index]] = tuple((float(result.time[a]), float(result.time[b - 1])) for a, b in runs)
    return found


def _process_noise(noise: ProcessNoise) -> ProcessNoisePart:
    return ProcessNoisePart(
        source=noise.source,
        density=noise.density,
        unit="m²" if noise.of_position else "m²/s³",
        bounds=noise.interval,
        significance=plain(noise.significance),
        displacement=plain(noise.displacement),
    )


def _finding(finding: Finding) -> FindingPart:
    kind = re.sub("(?<=[a-z])(?=[A-Z])", "-", type(finding).__name__).lower()  # LackOfFit: lack-of-fit
    return FindingPart.model_validate({"kind": kind, "text": sentence(finding)} | asdict(finding))
