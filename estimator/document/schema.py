"""The document of an estimate, with a versioned schema that pydantic derives from it.

A test compares docs/estimate.schema.json with it.
"""

import json
from typing import Any, Literal

from pydantic import Field

from baryscope.estimator.document.details import DetailsPart, Matrix, Part, Vector
from baryscope.estimator.result import Status

SCHEMA_VERSION: Literal[1] = 1

Interval = tuple[float, float]


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
        "contradicted-path",
        "different-points",
        "disagreeing-clusters",
        "other-body",
        "departure",
        "wrong-orbit",
        "estimated-orbit",
        "untold-oblateness",
        "untold-accuracy",
        "unknown-burn",
        "unknown-push",
        "wrong-sigma",
        "changing-noise",
        "depth-noise",
        "moving-features",
        "held-frames",
        "free-attitudes",
    ]
    text: str = Field(description="in words; not to be parsed")
    path: str | None = Field(None, description="lack-of-fit, departure: the path's model")
    magnitude: float | None = Field(
        None, description="lack-of-fit, departure: of the path from its model, rms, m; frames-left-out: median, m"
    )
    chi_square: float | None = Field(
        None,
        description="lack-of-fit: decrease of the normalised squares by a cubic in time, by score of degree 4",
    )
    dof: int | None = Field(None, description="lack-of-fit: expectation of chi_square for a right model")
    model: str | None = Field(None, description="excess-residuals: the path's model, or free tumble")
    ratio: float | None = Field(
        None,
        description="excess-residuals: residuals with the model over those without; disagreeing-clusters: "
        "how far apart they see their common features, over what they claim",
    )
    frames: int | None = Field(None, description="frames-left-out, few-frames, held-frames: their number")
    unknowns: float | None = Field(
        None, description="few-frames, follows-rotation: of path, offsets and tumble, or path, that are determined"
    )
    lasting: float | None = Field(
        None, description="few-frames: how many frames have the same errors of the features, and count as one"
    )
    labels: tuple[str, ...] | None = Field(
        None, description="different-points, disagreeing-clusters, moving-features, other-body: the labels in question"
    )
    clusters: tuple[int, int] | None = Field(
        None, description="different-points, disagreeing-clusters: indices of the two"
    )
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
    begin: float | None = Field(
        None, description="unknown-burn, frames-left-out, held-frames, extrapolated, contradicted-path, s"
    )
    begin_deviation: float | None = Field(None, description="unknown-burn: its standard deviation, s")
    end: float | None = Field(
        None, description="unknown-burn, frames-left-out, held-frames, extrapolated, contradicted-path, s"
    )
    end_deviation: float | None = Field(None, description="unknown-burn: its standard deviation, s")
    change: Vector | None = Field(None, description="unknown-burn: of the chaser's velocity, m/s")
    change_deviation: Vector | None = Field(None, description="unknown-burn: standard deviation of change, m/s")
    axes: Literal["lvlh", "inertial", "sun"] | None = Field(
        None, description="unknown-burn: axes of change; unknown-push: of acceleration, sun: away from it"
    )
    acceleration: tuple[float, ...] | None = Field(
        None, description="unknown-push: of the target less that of the chaser, mean over the tracks, m/s²"
    )
    acceleration_deviation: tuple[float, ...] | None = Field(
        None, description="unknown-push: standard deviation of acceleration, m/s²"
    )
    place: float | None = Field(None, description="untold-accuracy: standard deviation of the orbit, m")
    push: float | None = Field(None, description="untold-accuracy: standard deviation of a constant acceleration, m/s²")
    given: float | None = Field(None, description="wrong-sigma: a priori, m or a factor as sigma")
    found: float | None = Field(None, description="wrong-sigma: from the bodies alone, in the same unit")
    begins: tuple[float, ...] | None = Field(None, description="changing-noise: begins of the parts, s")
    deviations: tuple[float, ...] | None = Field(None, description="changing-noise: of a coordinate in each part, m")
    across: float | None = Field(None, description="depth-noise: deviation of a coordinate across the line of sight, m")
    along: float | None = Field(None, description="depth-noise: the same along it, m")
    told: float | None = Field(
        None, description="depth-noise: along over across by the tracks' covariances, null without any"
    )
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


def schema() -> dict[str, Any]:
    """The JSON schema of the document."""
    return EstimateDocument.model_json_schema(mode="serialization")


def schema_text() -> str:
    """The JSON schema as the text of docs/estimate.schema.json."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"
