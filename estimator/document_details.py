"""What a document holds of a method's own results, and the plain values that it is made of."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from baryscope.estimator import details as kinds

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


class Part(BaseModel):
    """A part of the document: nothing else may stand in it."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PivotPart(Part):
    """Of pivot."""

    kind: Literal["pivot"] = "pivot"
    tie_points: tuple[dict[str, tuple[int, int] | tuple[str, ...]], ...] = Field(
        description="indices of two clusters, and labels of their tie points"
    )
    position_noise: float = Field(description="standard deviation of white noise of the position, as of a slip, m")


class TumblePart(Part):
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
    torque_noise: float | None = Field(None, description="estimated density of the angular acceleration, rad²/s³")
    torque_noise_bounds: tuple[float, float] | None = Field(None, description="that hold 90 %")
    position_noise: float = Field(description="standard deviation of white noise of the position, as of a slip, m")


class FilterPart(Part):
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


class ScorePart(Part):
    """Of score."""

    kind: Literal["score"] = "score"
    centre_residual: float = Field(description="rms of c + R u − v per coordinate, m; large if the centre moves")


class ScrewPart(Part):
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


def number(value: Any) -> Any:
    """The value, None if it is a number that is not finite, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def vector(values: NDArray[np.float64]) -> Any:
    """Numbers (n,) as plain values."""
    return tuple(float(value) for value in values)


def matrix(values: NDArray[np.float64]) -> Any:
    """Rows (n, m) as plain values."""
    return tuple(vector(row) for row in values)


def details_part(found: kinds.Details) -> Any:
    """The part of a method's own results."""
    match found:
        case kinds.PivotDetails():
            return PivotPart(
                tie_points=tuple({"clusters": t.clusters, "labels": t.labels} for t in found.tie_points),
                position_noise=found.position_noise,
            )
        case kinds.TumbleDetails():
            values, axes = np.linalg.eigh(found.inertia)
            return TumblePart(
                epoch=found.epoch,
                attitude=matrix(found.attitude),
                angular_rate=vector(found.angular_rate),
                angular_rate_deviation=vector(found.angular_rate_deviation),
                inertia_over_trace=matrix(found.inertia),
                inertia_deviation=found.inertia_deviation,
                principal_moments_over_trace=vector(values),
                principal_axes=matrix(axes.T),
                gravity_gradient=found.gravity_gradient,
                torque_noise=found.torque_noise,
                torque_noise_bounds=found.torque_noise_bounds,
                position_noise=found.position_noise,
            )
        case kinds.FilterDetails():
            return FilterPart(
                order=found.order,
                process_noise=found.process_noise,
                process_noise_bounds=found.process_noise_bounds,
                torque_noise=found.torque_noise,
                torque_noise_bounds=found.torque_noise_bounds,
                gravity_gradient=found.gravity_gradient,
                mean_normalised_innovation_squared=number(found.nis),
                log_likelihood=number(found.log_likelihood),
                final_position_covariance=matrix(found.final_covariance),
                angular_rate=vector(found.angular_rate),
                inertia_over_trace=matrix(found.inertia),
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
                axis_spread=vector(found.axis_spread),
                axis_directions=matrix(found.axis_directions),
                screws=found.screws,
                intersections=found.intersections,
                com_scatter=tuple(tuple(number(v) for v in one.tolist()) for one in found.com_scatter),
            )
