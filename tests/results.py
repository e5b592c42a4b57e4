"""A constructed estimate, for tests of sentences and files."""

from dataclasses import replace

import numpy as np

from baryscope.estimator.adjustment.diagnostics import cluster_of, covered_by, observability_of
from baryscope.estimator.details import PivotDetails, TiedClusters
from baryscope.estimator.options import PathOptions
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import Interval
from baryscope.estimator.result import Estimate, Motion, Noise

LABELS = ("a", "b", "c", "d")
POINTS = np.array([[4.0, 0, 0], [2, 0, 0], [3, 1, 0], [3, -1, 0]])  # rms radius 1 m about (3, 0, 0)


def a_cluster(deviations, frames=10, axes=None):
    """A cluster of four features; standard deviations (3,) of the centre of mass along axes (columns)."""
    axes = np.eye(3) if axes is None else axes
    covariance = axes @ np.diag(np.square(deviations)) @ axes.T
    interval = Interval(0, frames, (0, 1, 2, 3))
    body = Body(np.arange(4), np.arange(frames), POINTS, np.tile(np.eye(3), (frames, 1, 1)), (interval,))
    return cluster_of(body, POINTS, covariance, LABELS)


def an_estimate(clusters=None, frames=10, **changes):
    """Ten frames of four features; the path has standard deviations of 1, 2 and 3 cm along the axes of C."""
    clusters = (a_cluster([0.01, 0.02, 0.03], frames),) if clusters is None else clusters
    covariance = np.tile(np.diag([1.0, 4.0, 9.0]) * 1e-4, (frames, 1, 1))
    plain = Estimate(
        time=np.arange(float(frames)),
        labels=LABELS,
        position=np.arange(3.0 * frames).reshape(frames, 3),
        covariance=covariance,
        motion=Motion(),
        observability=observability_of(clusters, covariance),
        clusters=clusters,
        noise=Noise(None, 0.02),
        residuals=np.full((frames, 4, 3), 0.01),
        used=np.ones((frames, 4), dtype=bool),
        rejected=np.zeros((frames, 4), dtype=bool),
        covered=covered_by(clusters, frames),
        converged=True,
        rounds=2,
        findings=(),
        method="pivot",
        path="fixed",
        options=PathOptions(),
        details=PivotDetails((TiedClusters((0, 1), ("a", "c")),)),
        wall_time=0.25,
    )
    return replace(plain, **changes)
