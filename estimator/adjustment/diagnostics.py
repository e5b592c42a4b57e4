"""From the numbers of an adjustment to the values of a result: clusters, observability, residuals, what is rejected."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.adjustment.observations import as_slice
from baryscope.estimator.registration.body import Body
from baryscope.estimator.result import UNOBSERVABLE, Cluster, Observability, PrincipalAxes

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

REJECTED = 0.5  # weight below which an observation counts as rejected


def cluster_of(body: Body, points: FloatArray, covariance: FloatArray, labels: Sequence[str]) -> Cluster:
    """The cluster that a body is, with points (m, 3) seen from the centre of mass and their centroid's covariance."""
    centroid = points.mean(axis=0)
    own = tuple(labels[index] for index in body.features)
    return Cluster(own, body.features, body.frames, body.intervals, points - centroid, -centroid, covariance)


def main_cluster(clusters: Sequence[Cluster]) -> int:
    """The number of the cluster that has an attitude in most frames."""
    return max(range(len(clusters)), key=lambda index: len(clusters[index].frames))


def observability_of(clusters: Sequence[Cluster], position_covariance: FloatArray) -> Observability:
    """How well the centre of mass is seen, from clusters with covariances and the path's covariance (n, 3, 3)."""
    main = main_cluster(clusters)
    covariance = clusters[main].covariance
    if covariance is None:
        raise ValueError("the cluster has no covariance")
    return Observability(
        PrincipalAxes.of(covariance),
        PrincipalAxes.of(position_covariance.mean(axis=0)),
        main,
        UNOBSERVABLE * clusters[main].radius,
    )


def rejected_by(weight: FloatArray) -> BoolArray:
    """Which observations count as wrong, from their weights (n, m), which are 0 where none is used."""
    return np.asarray((weight > 0) & (weight < REJECTED))


def covered_by(clusters: Sequence[Cluster], frames: int) -> BoolArray:
    """At which of the frames some cluster has an attitude, (frames,)."""
    covered = np.zeros(frames, dtype=bool)
    for cluster in clusters:
        covered[cluster.frames] = True
    return covered


def residuals_of(position: FloatArray, bodies: Sequence[Body], origin: FloatArray) -> FloatArray:
    """Observed positions (n, m, 3) in m less estimated ones, of bodies whose points are seen from origin (n, 3).

    NaN where a feature is not seen, or no body that has it has an attitude.
    """
    residual = np.full_like(position, np.nan)
    for body in bodies:
        image = body.points @ np.swapaxes(body.attitude, 1, 2)
        image += origin[body.frames][:, None]
        frames, features = as_slice(body.frames), as_slice(body.features)
        block = (frames, features) if isinstance(features, slice) else np.ix_(body.frames, body.features)
        np.subtract(position[block], image, out=image)
        residual[block] = image
    return residual


def attitude_series(body: Body, frames: int) -> FloatArray:
    """A body's attitude R_C_S at all frames, (frames, 3, 3), NaN where it has none."""
    attitude = np.full((frames, 3, 3), np.nan)
    attitude[body.frames] = body.attitude
    return attitude
