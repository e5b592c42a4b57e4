"""What is said of a path that was estimated with a covariance: how good, where not observable, what was rejected."""

import time as clock
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.clusters import PosedBody
from baryscope.estimator.registration.intervals import Interval
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

BLIND = 0.25  # deviation over the features' radius, from which on a direction counts as not observable
REJECTED = 0.5  # weight below which an observation counts as rejected
PERSISTENT = 0.5  # share of a feature's observations rejected, from which on the feature is


@dataclass(frozen=True, eq=False)
class Cluster:
    """Features that hold axes of their own.

    features (m,) and frames (n,): indices into the tracks; intervals in which it was seen; points (m, 3) in m from the
    centre of mass; covariance (3, 3) in m² of their centroid, seen from it in the axes that the points hold.
    """

    features: IntArray
    frames: IntArray
    intervals: tuple[Interval, ...]
    points: FloatArray
    covariance: FloatArray

    @property
    def centre_of_mass(self) -> FloatArray:
        """The centre of mass seen from the features' centroid, (3,) in m."""
        return np.asarray(-self.points.mean(axis=0))

    @property
    def radius(self) -> float:
        """Of the features about their centroid, rms, in m."""
        return float(np.sqrt(((self.points - self.points.mean(axis=0)) ** 2).sum() / len(self.points)))


def clusters_of(
    posed: Iterable[PosedBody], points: Iterable[FloatArray], covariances: Iterable[FloatArray]
) -> list[Cluster]:
    """The clusters that bodies are, with their points from the centre of mass and the offsets' covariances."""
    return [
        Cluster(one.body.features, one.body.frames, one.intervals, of_one, covariance)
        for one, of_one, covariance in zip(posed, points, covariances, strict=True)
    ]


def assessed(
    method: str,
    tracks: FeatureTracks,
    trajectory: str,
    position: FloatArray,
    covariance: FloatArray,
    clusters: list[Cluster],
    *,
    weights: FloatArray,
    variance: float,
    options: PathOptions,
    begin: float,
    extra: dict[str, Any],
    remarks: tuple[str, ...] = (),
) -> Estimate:
    """The estimate with its diagnostics.

    weights (n, m): 0 where an observation was not used, else the probability that it is right; variance of an
    observation of weight 1, in m² or, with covariances, over the given one; begin: clock.perf_counter() at the start;
    remarks: what the user should know besides.
    """
    main = max(clusters, key=lambda cluster: len(cluster.frames))
    values, vectors = np.linalg.eigh(main.covariance)
    covered = np.zeros(len(tracks.time), dtype=bool)
    for cluster in clusters:
        covered[cluster.frames] = True
    diagnostics = {
        "method": method,
        "version": version("baryscope"),
        "options": asdict(options) | {"trajectory": trajectory},
        "residual_rms": float(np.sqrt(variance)) if tracks.covariance is None else None,
        "variance_factor": None if tracks.covariance is None else float(variance),
        "condition_number": float(values[-1] / values[0]) if values[0] > 0 else None,
        "least_observable_direction": {
            "axes": f"cluster {clusters.index(main)}",
            "direction": vectors[:, -1].tolist(),
            "deviation": float(np.sqrt(max(values[-1], 0.0))),
        },
        "verdict": verdict(main),
        "remarks": list(remarks),
        "position_deviation": float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean())),
        "covered_share": float(covered.mean()),
        "clusters": [_described(cluster, tracks) for cluster in clusters],
        **_rejections(tracks, weights),
        **extra,
        "wall_time": clock.perf_counter() - begin,
    }
    return Estimate(tracks.time, position, covariance, diagnostics)


def three_sigma_factor(values: int) -> float:
    """The factor up to which what noise seems to show may exceed its mean: three deviations of a mean of squares."""
    return float(1 + 3 * np.sqrt(2 / values))


def spurious_information_columns(
    offset: FloatArray, crossed: FloatArray, spurious: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """What a covariance lacks whose information is partly spurious, as columns to be squared and added.

    offset (k, k): covariance of one offset or of several; crossed (k, p): that with other unknowns; spurious (k, k):
    information of the offsets that there is not; least: what remains at least. Returns the columns of the offsets
    (k, k) and those of the other unknowns (p, k): the joint information less `spurious`, inverted again (Woodbury).
    """
    information = np.linalg.pinv(offset, hermitian=True)
    values, axes = np.linalg.eigh(information)
    seen = values > 0
    true = np.maximum(values - np.einsum("ik,ij,jk->k", axes, spurious, axes), least)
    lacking = np.where(seen, 1 / np.maximum(true, 1e-300) - 1 / np.where(seen, values, 1.0), 0.0)
    columns = axes * np.sqrt(np.maximum(lacking, 0.0))
    return columns, crossed.T @ information @ columns


def verdict(cluster: Cluster) -> str:
    """Whether the centre of mass was observable in the cluster's axes, in a sentence with the worst deviation."""
    values, vectors = np.linalg.eigh(cluster.covariance)
    worst = float(np.sqrt(max(values[-1], 0.0)))
    blind = np.sqrt(np.maximum(values, 0.0)) > BLIND * cluster.radius
    if not blind.any():
        return f"observable: ±{worst:.2g} m in the worst direction"
    if blind.all():
        return f"position not observable: ±{worst:.2g} m"
    if blind.sum() == 2:
        return f"position across {_named(vectors[:, 0])} not observable: ±{worst:.2g} m"
    return f"along-axis position not observable: ±{worst:.2g} m along {_named(vectors[:, -1])} (cluster axes)"


def _named(direction: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in direction) + ")"


def _described(cluster: Cluster, tracks: FeatureTracks) -> dict[str, Any]:
    centroid = cluster.points.mean(axis=0)
    return {
        "start": float(tracks.time[cluster.frames[0]]),
        "end": float(tracks.time[cluster.frames[-1]]),
        "frames": len(cluster.frames),
        "intervals": [
            [float(tracks.time[interval.start]), float(tracks.time[interval.stop - 1])]
            for interval in cluster.intervals
        ],
        "features": {
            tracks.labels[index]: point.tolist()
            for index, point in zip(cluster.features, cluster.points - centroid, strict=True)
        },
        "centre_of_mass": cluster.centre_of_mass.tolist(),
        "centre_of_mass_covariance": cluster.covariance.tolist(),
    }


def _rejections(tracks: FeatureTracks, weights: FloatArray) -> dict[str, Any]:
    """The features that were wrong most of the time, and for all features the stretches of rejected observations."""
    used = weights > 0
    wrong = used & (weights < REJECTED)
    counts, totals = wrong.sum(axis=0), np.maximum(used.sum(axis=0), 1)
    stretches = {}
    for index in np.nonzero(counts)[0]:
        edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong[:, index], [False]]).astype(np.int8)))
        stretches[tracks.labels[index]] = [
            [float(tracks.time[first]), float(tracks.time[stop - 1])] for first, stop in edges.reshape(-1, 2)
        ]
    return {
        "rejected_features": [tracks.labels[index] for index in np.nonzero(counts > PERSISTENT * totals)[0]],
        "rejected_share": float(wrong.sum() / max(used.sum(), 1)),
        "rejected_observations": stretches,
    }
