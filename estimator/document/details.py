"""What a document holds of a method's own results, and the plain values that it is made of."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from baryscope.estimator import details as kinds

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

SLIP = "standard deviation of noise of the position, as of a slip, m: of white noise that costs as much"


class Part(BaseModel):
    """A part of the document: nothing else may stand in it."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PivotPart(Part):
    """Of pivot."""

    kind: Literal["pivot"] = "pivot"
    tie_points: tuple[dict[str, tuple[int, int] | tuple[str, ...]], ...] = Field(
        description="indices of two clusters, and labels of their tie points"
    )
    position_noise: float = Field(description=SLIP)


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
    position_noise: float = Field(description=SLIP)


class FilterPart(Part):
    """Of ekf."""

    kind: Literal["filter"] = "filter"
    process_noise: float = Field(description="density of the path's acceleration, m²/s³; of a fixed point's place, m²")
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


def plain(value: Any) -> Any:
    """The value as JSON has it: arrays as tuples, and None for a number that is not finite."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(plain(one) for one in value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def details_part(found: kinds.Details) -> Any:
    """The part of a method's own results."""
    match found:
        case kinds.PivotDetails():
            ties = tuple({"clusters": tied.clusters, "labels": tied.labels} for tied in found.tie_points)
            return _part(PivotPart, found, tie_points=ties)
        case kinds.TumbleDetails():
            values, axes = np.linalg.eigh(found.inertia)
            return _part(
                TumblePart,
                found,
                inertia_over_trace=found.inertia,
                principal_moments_over_trace=values,
                principal_axes=axes.T,
            )
        case kinds.FilterDetails():
            return _part(
                FilterPart,
                found,
                mean_normalised_innovation_squared=found.nis,
                final_position_covariance=found.final_covariance,
                inertia_over_trace=found.inertia,
            )
        case kinds.ScoreDetails():
            return _part(ScorePart, found)
        case kinds.ScrewDetails():
            return _part(ScrewPart, found, chosen_from_data=found.chosen)


def _part(part: type[Part], found: kinds.Details, **others: Any) -> Part:
    """A part whose fields are those of the details, plain; others: the fields of another name, or another content."""
    same = {name: getattr(found, name) for name in part.model_fields if hasattr(found, name)}
    return part.model_validate({name: plain(value) for name, value in (same | others).items()})
