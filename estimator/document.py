"""An estimate as files: the path as CSV, and everything else as JSON with a documented, versioned schema.

The schema is derived from `EstimateDocument` by pydantic; a test compares docs/estimate.schema.json with it.
"""

import csv
import json
import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated, Any, Literal, TextIO

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from baryscope.estimator import details as kinds
from baryscope.estimator.prose import sentence, verdict
from baryscope.estimator.result import (
    Cluster,
    DifferentPoints,
    Estimate,
    ExcessResiduals,
    Finding,
    LackOfFit,
    Observability,
    PrincipalAxes,
    Status,
)
from baryscope.estimator.tables.tracks import COVARIANCE_COLUMNS, UPPER
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import InputError
from baryscope.models.files import AnyPath, write_together

SCHEMA_VERSION: Literal[1] = 1

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Interval = tuple[float, float]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class AxesPart(_Part):
    """Principal axes of a covariance."""

    deviations: Vector = Field(description="standard deviations, ascending, m")
    directions: Matrix = Field(description="a unit vector a row, one for each deviation")


class ObservabilityPart(_Part):
    """Observability of the centre of mass."""

    verdict: str = Field(description="in words; not to be parsed")
    cluster: int = Field(description="index of the cluster whose axes `body` refers to: that of most frames")
    threshold: float = Field(description="standard deviation above which a direction is not observable, m")
    observable: tuple[bool, bool, bool] = Field(description="for each direction of `body`")
    condition_number: float | None = Field(description="greatest over least variance in body axes")
    body: AxesPart = Field(description="of the centre of mass in the cluster's axes")
    inertial: AxesPart = Field(description="of the path in C, mean over all times")


class NoisePart(_Part):
    """Standard deviation of an observation's coordinate."""

    a_priori: float | None = Field(description="as given with --sigma")
    a_posteriori: float = Field(description="from the residuals")
    unit: Literal["m", "1"] = Field(description="1: a factor on the standard deviations given with the tracks")


class ClusterPart(_Part):
    """A rigid cluster of features."""

    start: float = Field(description="first time with an attitude, s")
    end: float = Field(description="last time with an attitude, s")
    frames: int = Field(description="number of frames with an attitude")
    intervals: tuple[Interval, ...] = Field(description="begin and end of the periods in which it is tracked, s")
    features: dict[str, Vector] = Field(description="points in cluster axes from their centroid, m")
    centre_of_mass: Vector | None = Field(description="in the same axes, from the centroid, m")
    centre_of_mass_covariance: Matrix | None = Field(description="m², in axes attached to the points")


class RejectedPart(_Part):
    """Rejected observations."""

    share: float = Field(description="of the used observations")
    features: tuple[str, ...] = Field(description="features with most of their observations rejected")
    intervals: dict[str, tuple[Interval, ...]] = Field(description="for each feature, from first to last time, s")


class ForcePart(_Part):
    """An estimated factor of a force."""

    name: str = Field(description="acceleration scale (its relative error), or a component of a constant acceleration")
    value: float
    deviation: float = Field(description="standard deviation")
    unit: Literal["1", "m/s²"]


class FindingPart(_Part):
    """Evidence against a model."""

    kind: Literal["lack-of-fit", "excess-residuals", "different-points"]
    text: str = Field(description="in words; not to be parsed")
    path: str | None = Field(None, description="lack-of-fit: the path's model")
    magnitude: float | None = Field(None, description="lack-of-fit: rms departure of the path, m")
    chi_square: float | None = Field(
        None, description="lack-of-fit: decrease of the normalised squares by a cubic in time"
    )
    dof: int | None = Field(None, description="lack-of-fit: expectation of chi_square for a right model")
    model: str | None = Field(None, description="excess-residuals: the path's model, or free tumble")
    ratio: float | None = Field(None, description="excess-residuals: residuals with the model over those without")
    labels: tuple[str, ...] | None = Field(None, description="different-points: labels of different points")
    clusters: tuple[int, int] | None = Field(None, description="different-points: indices of the two clusters")


class PivotPart(_Part):
    """Of pivot."""

    kind: Literal["pivot"] = "pivot"
    tie_points: tuple[dict[str, tuple[int, int] | tuple[str, ...]], ...] = Field(
        description="indices of two clusters, and labels of their tie points"
    )


class TumblePart(_Part):
    """Of ml: the rotational state."""

    kind: Literal["tumble"] = "tumble"
    epoch: float = Field(description="s")
    attitude: Matrix = Field(description="rotation from body axes to C, at the epoch")
    angular_rate: Vector = Field(description="body axes, at the epoch, rad/s")
    angular_rate_deviation: Vector = Field(description="rad/s")
    inertia_over_trace: Matrix = Field(description="body axes")
    inertia_deviation: float = Field(description="Frobenius norm")
    principal_moments_over_trace: Vector
    principal_axes: Matrix = Field(description="body axes, a unit vector a row")
    gravity_gradient: bool


class FilterPart(_Part):
    """Of ekf."""

    kind: Literal["filter"] = "filter"
    order: int = Field(description="of the noisy derivative of the path")
    process_noise: float = Field(description="density of the next derivative, of order 1 in m²/s³; of order 0 in m²")
    process_noise_bounds: tuple[float, float] = Field(description="that hold 90 %")
    torque_noise: float = Field(description="density of the angular acceleration, rad²/s³")
    torque_noise_bounds: tuple[float, float] = Field(description="that hold 90 %")
    gravity_gradient: bool
    mean_normalised_innovation_squared: float | None = Field(description="1 is expected")
    log_likelihood: float | None
    final_position_covariance: Matrix = Field(description="of the filter at the last time, C, m²")
    angular_rate: Vector = Field(description="body axes, at the last time, rad/s")
    inertia_over_trace: Matrix


class ScorePart(_Part):
    """Of score."""

    kind: Literal["score"] = "score"
    centre_residual: float = Field(description="rms of c + R u − v per coordinate, m; large if the centre moves")


class ScrewPart(_Part):
    """Of the screw methods."""

    kind: Literal["screw"] = "screw"
    chosen_from_data: tuple[str, ...]
    sampling_interval: float = Field(description="s")
    screw_angle: float = Field(description="median, rad")
    axis_angle: float = Field(description="median between successive axes, rad")
    segment_rms: float = Field(description="of the shortest segments between successive axes, m")
    segment_median: float = Field(description="m")
    fit_rms: float = Field(description="of the path's polynomial, per coordinate, m")
    axis_spread: Vector = Field(description="eigenvalues, ascending, of the mean of 1 − a aᵀ")
    axis_directions: Matrix = Field(description="their eigenvectors, a row each")
    screws: dict[str, int]
    intersections: dict[str, int]
    com_scatter: tuple[tuple[float | None, float | None, float | None], ...] = Field(
        description="standard deviation of the centre of mass in each cluster's axes, m"
    )


DetailsPart = Annotated[PivotPart | TumblePart | FilterPart | ScorePart | ScrewPart, Field(discriminator="kind")]


class EstimateDocument(_Part):
    """The JSON file that `baryscope estimate` writes beside the path of the centre of mass."""

    schema_version: Literal[1] = SCHEMA_VERSION
    version: str = Field(description="of baryscope")
    method: str
    status: Status = Field(description="whether the estimate can be used")
    path: str = Field(description="the path's model: fixed, polynomial:N, relative-orbit, fixed in LVLH")
    options: dict[str, str | float | int | None] = Field(description="as given or chosen; null: not given, not needed")
    converged: bool
    rounds: int
    coverage: float = Field(description="share of the times at which the tracks determine an attitude")
    predicted_rmse: float | None = Field(description="of the path, from its covariance, m")
    noise: NoisePart
    observability: ObservabilityPart | None
    clusters: tuple[ClusterPart, ...]
    residual_rms: dict[str, float | None] = Field(description="of each feature, per coordinate, m")
    rejected: RejectedPart
    forces: tuple[ForcePart, ...] = Field(description="estimated factors of forces")
    findings: tuple[FindingPart, ...]
    details: DetailsPart
    wall_time: float = Field(description="s")


def document_of(result: Estimate) -> EstimateDocument:
    """The document of an estimate: everything except its series over time."""
    return EstimateDocument(
        version=result.version,
        method=result.method,
        status=result.status,
        path=result.path,
        options={field.name: _option(getattr(result.options, field.name)) for field in fields(result.options)},
        converged=result.converged,
        rounds=result.rounds,
        coverage=result.coverage,
        predicted_rmse=_number(result.predicted_rmse),
        noise=NoisePart(
            a_priori=result.noise.a_priori,
            a_posteriori=result.noise.a_posteriori,
            unit="1" if result.noise.relative else "m",
        ),
        observability=None if result.observability is None else _observability(result.observability),
        clusters=tuple(_cluster(cluster, result) for cluster in result.clusters),
        residual_rms={
            label: _number(value) for label, value in zip(result.labels, result.feature_rms.tolist(), strict=True)
        },
        rejected=RejectedPart(
            share=result.rejected_share, features=result.rejected_features, intervals=rejected_intervals(result)
        ),
        forces=tuple(ForcePart.model_validate(asdict(force)) for force in result.forces),
        findings=tuple(_finding(finding) for finding in result.findings),
        details=_details(result.details),
        wall_time=result.wall_time,
    )


def schema() -> dict[str, Any]:
    """The JSON schema of the document."""
    return EstimateDocument.model_json_schema(mode="serialization")


def schema_text() -> str:
    """The JSON schema as the text of docs/estimate.schema.json."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"


def write_estimate(result: Estimate, path: AnyPath) -> None:
    """Write the path as a CSV file, and the document beside it with the suffix .json.

    Raises:
        InputError: a file cannot be written, or the two names are one.
    """
    path = Path(path)
    beside = path.with_suffix(".json")
    if beside == path:
        raise InputError(f"{path}: this name is kept for the diagnostics, expected another suffix than .json")
    n = len(result.time)
    columns: list[list[object]] = [result.time.tolist(), *(result.position[:, axis].tolist() for axis in range(3))]
    for row, column in UPPER:
        columns.append([""] * n if result.covariance is None else result.covariance[:, row, column].tolist())
    text = json.dumps(document_of(result).model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False)

    def write_rows(stream: TextIO) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("time", "x", "y", "z", *COVARIANCE_COLUMNS))
        writer.writerows(zip(*columns, strict=True))

    write_together({path: write_rows, beside: lambda stream: stream.write(text + "\n")})


def _option(value: Any) -> Any:
    """An option as JSON has it, a known acceleration in words."""
    return str(value) if isinstance(value, KnownAcceleration) else _number(value)


def _number(value: Any) -> Any:
    """The value, None if it is a number that is not finite, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _vector(values: NDArray[np.float64]) -> Any:
    return tuple(float(value) for value in values)


def _matrix(values: NDArray[np.float64]) -> Any:
    return tuple(_vector(row) for row in values)


def _axes(axes: PrincipalAxes) -> AxesPart:
    return AxesPart(deviations=_vector(axes.deviations), directions=_matrix(axes.directions))


def _observability(found: Observability) -> ObservabilityPart:
    first, second, third = found.observable.tolist()
    return ObservabilityPart(
        verdict=verdict(found),
        cluster=found.cluster,
        threshold=found.threshold,
        observable=(first, second, third),
        condition_number=_number(found.condition_number),
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
            label: _vector(point)
            for label, point in zip(cluster.labels, cluster.points, strict=True)
            if np.isfinite(point).all()
        },
        centre_of_mass=_vector(cluster.centre_of_mass) if np.isfinite(cluster.centre_of_mass).all() else None,
        centre_of_mass_covariance=None if cluster.covariance is None else _matrix(cluster.covariance),
    )


def rejected_intervals(result: Estimate) -> dict[str, tuple[Interval, ...]]:
    """For each feature with rejected observations, their intervals from first to last time, s."""
    found = {}
    for index in np.nonzero(result.rejected.any(axis=0))[0]:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], result.rejected[:, index], [False]]).astype(np.int8)))
        found[result.labels[index]] = tuple(
            (float(result.time[first]), float(result.time[stop - 1])) for first, stop in edges.reshape(-1, 2)
        )
    return found


def _finding(finding: Finding) -> FindingPart:
    names = {LackOfFit: "lack-of-fit", ExcessResiduals: "excess-residuals", DifferentPoints: "different-points"}
    return FindingPart.model_validate({"kind": names[type(finding)], "text": sentence(finding)} | asdict(finding))


def _details(found: kinds.Details) -> Any:
    match found:
        case kinds.PivotDetails():
            return PivotPart(tie_points=tuple({"clusters": t.clusters, "labels": t.labels} for t in found.tie_points))
        case kinds.TumbleDetails():
            values, axes = np.linalg.eigh(found.inertia)
            return TumblePart(
                epoch=found.epoch,
                attitude=_matrix(found.attitude),
                angular_rate=_vector(found.angular_rate),
                angular_rate_deviation=_vector(found.angular_rate_deviation),
                inertia_over_trace=_matrix(found.inertia),
                inertia_deviation=found.inertia_deviation,
                principal_moments_over_trace=_vector(values),
                principal_axes=_matrix(axes.T),
                gravity_gradient=found.gravity_gradient,
            )
        case kinds.FilterDetails():
            return FilterPart(
                order=found.order,
                process_noise=found.process_noise,
                process_noise_bounds=found.process_noise_bounds,
                torque_noise=found.torque_noise,
                torque_noise_bounds=found.torque_noise_bounds,
                gravity_gradient=found.gravity_gradient,
                mean_normalised_innovation_squared=_number(found.nis),
                log_likelihood=_number(found.log_likelihood),
                final_position_covariance=_matrix(found.final_covariance),
                angular_rate=_vector(found.angular_rate),
                inertia_over_trace=_matrix(found.inertia),
            )
        case kinds.ScoreDetails():
            return ScorePart(centre_residual=found.centre_residual)
        case kinds.ScrewDetails():
            return ScrewPart(
                chosen_from_data=found.chosen,
                sampling_interval=found.sampling_interval,
                screw_angle=found.screw_angle,
                axis_angle=found.axis_angle,
                segment_rms=found.segment_rms,
                segment_median=found.segment_median,
                fit_rms=found.fit_rms,
                axis_spread=_vector(found.axis_spread),
                axis_directions=_matrix(found.axis_directions),
                screws=found.screws,
                intersections=found.intersections,
                com_scatter=tuple(tuple(_number(v) for v in one.tolist()) for one in found.com_scatter),
            )
