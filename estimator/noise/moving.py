"""Features that move on the body: on a panel that bends, on skin, along an edge that a tracker slides on.

Errors of all features may last, and then do so alike; the claim knows how long. The errors of a few that move on the
body last longer than those of the others, are alike where they are on one panel, and turn with the body as a centre of
mass elsewhere does: they draw the estimate by more than it claims. Where the others are enough, it is made of these.

A feature may move so slowly that it does not seem to while it is seen without a break, as a glint. Then it comes back
on another place, beside others that are where they were. So does a label that a tracker gives to another point, but of
those that are like that few are enough.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.findings import DifferentPoints, MovingFeatures
from baryscope.estimator.geometry.alignment import FEWEST_POINTS
from baryscope.estimator.noise.rigid_features import WindowMeans
from baryscope.estimator.result import Estimate
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError

BoolArray = NDArray[np.bool_]
Fit = Callable[[FeatureTracks], tuple[Estimate, FeatureTracks]]

SHOWN = 20  # observations of a feature that counts
ENOUGH = 0.5  # share of the features that are left, at least
COVERED = 0.9  # share of the frames with an attitude that keep it, at least
MOST_FITS = 4


def without_moving_features(fit: Fit, tracks: FeatureTracks) -> Estimate:
    """The estimate by a fit, without the features that move on the body if the others are enough.

    Args:
        fit: gives an estimate, and the tracks with the covariances that it took.
        tracks: in C.

    Raises:
        ComputationError: the tracks do not determine the unknowns.
    """
    answer, weighed = fit(tracks)
    first, moving = answer, np.zeros(len(tracks.labels), dtype=bool)
    for _ in range(MOST_FITS):
        more = moving | _moving(answer, weighed)
        if (more == moving).all():
            break
        shown = tracks.seen.sum(axis=0) >= SHOWN
        if (shown & ~more).sum() < max(ENOUGH * shown.sum(), FEWEST_POINTS):
            break
        try:
            found, weighed = fit(replace(tracks, position=np.where(more[:, None], np.nan, tracks.position)))
        except ComputationError:
            break
        if found.covered.sum() < COVERED * first.covered.sum():
            break
        moving, answer = more, replace(found, wall_time=answer.wall_time + found.wall_time)
    if not moving.any():
        return answer
    labels = tuple(label for label, moves in zip(tracks.labels, moving, strict=True) if moves)
    return replace(answer, findings=(*answer.findings, MovingFeatures(labels)))


def _moving(found: Estimate, tracks: FeatureTracks) -> BoolArray:
    """Which of the tracks' labels (m,) are of features that move on the body, as the residuals of an estimate tell, or
    that came back on another place.
    """
    if not found.converged:
        return np.zeros(len(tracks.labels), dtype=bool)
    moving = np.isin(tracks.labels, _elsewhere(found))
    means = WindowMeans.of(found, tracks)
    if means is not None and means.suspicious:
        moving[found.sources(tracks.labels)[means.moving()]] = True
    return moving


def _elsewhere(found: Estimate) -> list[str]:
    """The labels that came back on another place, beside enough others that did not."""
    labels: list[str] = []
    for one in found.findings:
        if isinstance(one, DifferentPoints):
            first, second = (set(found.clusters[index].labels) for index in one.clusters)
            if len((first & second).difference(one.labels)) >= FEWEST_POINTS:
                labels += one.labels
    return labels
