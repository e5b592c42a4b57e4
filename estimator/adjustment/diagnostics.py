"""From an adjustment to the values of a result: clusters, observability, residuals, rejected observations."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.reweighting import REJECTED
from baryscope.estimator.findings import FewFrames
from baryscope.estimator.geometry.gauge import are_in_line
from baryscope.estimator.geometry.symmetric import made_definite, symmetric_inverses
from baryscope.estimator.observability import UNOBSERVABLE, Observability, PrincipalAxes
from baryscope.estimator.registration.body import Body
from baryscope.estimator.result import Cluster
from baryscope.models.errors import ComputationError, Reason

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ATTITUDE = 2  # observations of a frame that tell an attitude, together with path and offset


def cluster_of(body: Body, points: FloatArray, covariance: FloatArray, labels: Sequence[str]) -> Cluster:
    """The body as a cluster of a result.

    points (m, 3) in m from the centre of mass, in the body's axes; covariance (3, 3) of their centroid, m²; labels of
    all features of the tracks. The axes of features in a line are those in which the centre of mass is in one plane
    with the line: it is not uncertain across it.
    """
    centroid = points.mean(axis=0)
    if are_in_line(points):
        covariance = made_definite(covariance[None])[0]
    own = tuple(labels[index] for index in body.features)
    return Cluster(own, body.features, body.frames, body.intervals, points - centroid, -centroid, covariance)


def main_cluster(clusters: Sequence[Cluster] | Sequence[Body]) -> int:
    """The index of the cluster, or body, with an attitude in the most frames."""
    return max(range(len(clusters)), key=lambda index: len(clusters[index].frames))


def observability_of(clusters: Sequence[Cluster], position_covariance: FloatArray) -> Observability:
    """The observability of the centre of mass, from clusters with covariances and the path's covariance (n, 3, 3), m².

    Raises:
        ValueError: the main cluster has no covariance.
        ComputationError: the path's covariance is lost in rounding: its mean over time has a negative trace.
    """
    mean = position_covariance.mean(axis=0)
    if np.trace(mean) < 0:
        raise ComputationError(
            "the covariance of the path is lost in rounding: clusters of very few frames, or too unequal covariances",
            Reason.DIVERGED,
        )
    main = main_cluster(clusters)
    covariance = clusters[main].covariance
    if covariance is None:
        raise ValueError("the cluster has no covariance")
    return Observability(
        PrincipalAxes.of(covariance),
        PrincipalAxes.of(mean),
        main,
        UNOBSERVABLE * clusters[main].radius,
    )


def rejected_by(weight: FloatArray) -> BoolArray:
    """The rejected observations (n, m), from the weights (n, m), which are 0 where no observation is used."""
    return np.asarray((weight > 0) & (weight < REJECTED))


def few_frames(weight: FloatArray, unknowns: float, lasting: float) -> tuple[FewFrames, ...]:
    """A finding if frames with an attitude, by weights (n, m), are too few for the unknowns of path and tumble.

    lasting: how many frames have the same errors of the features, and count as one.

    The attitude of a frame tells of a tumble as much as its position of the path: half as many frames check as many
    unknowns as with free attitudes, where as many frames are needed as path and offsets have unknowns.
    """
    unknowns += 3  # of the offset
    frames = len(with_attitude(weight >= REJECTED))
    return (FewFrames(frames, unknowns, lasting),) if 2 * frames / lasting < unknowns else ()


def with_attitude(used: BoolArray) -> IntArray:
    """The frames with an attitude, by the observations (n, m) that are used and not rejected."""
    return np.flatnonzero(used.sum(axis=1) >= ATTITUDE)


def covered_by(clusters: Sequence[Cluster], frames: int) -> BoolArray:
    """The frames in which some cluster has an attitude, (frames,)."""
    covered = np.zeros(frames, dtype=bool)
    for cluster in clusters:
        covered[cluster.frames] = True
    return covered


def residuals_of(position: FloatArray, bodies: Sequence[Body], origin: FloatArray) -> FloatArray:
    """Residuals (n, m, 3) in m: observed position less estimated, in C, of bodies with points from origin (n, 3) in C.

    NaN where a feature is not seen, or no body with this feature has an attitude.
    """
    residual = np.full_like(position, np.nan)
    for body in bodies:
        image = body.places(origin)
        np.subtract(position[body.block], image, out=image)
        residual[body.block] = image
    return residual


def attitude_series(body: Body, frames: int) -> FloatArray:
    """The body's attitude R_C_S in all frames, (frames, 3, 3), NaN where it has none."""
    attitude = np.full((frames, 3, 3), np.nan)
    attitude[body.frames] = body.attitude
    return attitude


def information_in_body(shown: BoolArray, covariance: FloatArray | None, turn: FloatArray) -> FloatArray:
    """The information (n, m, 3, 3) of observations in axes of the body, 0 where they are not shown (n, m).

    covariance: (n, m, 3, 3) in C; None of observations that are equally good, of which it is 1. turn: R_C_B (n, 3, 3).
    """
    if covariance is None:
        return np.asarray(shown[..., None, None] * np.eye(3))
    inverse = symmetric_inverses(np.where(shown[..., None, None], covariance, np.eye(3)))
    return np.asarray(shown[..., None, None] * (np.swapaxes(turn, 1, 2)[:, None] @ inverse @ turn[:, None]))
