"""Labels that a tracker used twice: features of one label that are different points in different bodies."""

from dataclasses import replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.pivot.pivot_solution import PivotSolution
from baryscope.estimator.tracks import FeatureTracks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def relabelled(tracks: FeatureTracks, pivot: PivotSolution) -> tuple[FeatureTracks, PivotSolution]:
    """The tracks and the solution of `pivot` with a column for each point.

    The second point of a label F3 becomes F3 (2), and so on. Bodies whose tie point was refused see different points.
    An observation outside all bodies belongs to the point of the body with the nearest frame.
    """
    if not pivot.different:
        return tracks, pivot
    labels, source = list(tracks.labels), list(range(len(tracks.labels)))
    kept = [np.ones(len(tracks.time), dtype=bool) for _ in source]
    columns = [body.features.copy() for body in pivot.bodies]
    for feature in sorted({int(index) for tie in pivot.different for index in tie.features}):
        points = _points_of(feature, pivot)
        nearest = _nearest_holder(feature, pivot, len(tracks.time))
        for number in range(max(points.values()) + 1):
            holders = [index for index, point in points.items() if point == number]
            mask, column = np.isin(nearest, holders), len(source) if number else feature
            if number:
                numbered = (f"{tracks.labels[feature]} ({k})" for k in count(number + 1))
                labels.append(next(label for label in numbered if label not in labels))
                source.append(feature)
                kept.append(mask)
            else:
                kept[feature] = mask
            for index in holders:
                columns[index][pivot.bodies[index].features == feature] = column
    return _in_columns(tracks, pivot, labels, np.array(source), np.stack(kept, axis=1), columns)


def _points_of(feature: int, pivot: PivotSolution) -> dict[int, int]:
    """The number of the point that each body with the feature sees: that of the last body before it that agrees."""
    refused_pairs = {tie.bodies for tie in pivot.different if feature in tie.features}
    found: dict[int, int] = {}
    for index, body in enumerate(pivot.bodies):
        if feature in body.features:
            other = {number for before, number in found.items() if (before, index) in refused_pairs}
            same = [number for number in found.values() if number not in other]
            found[index] = same[-1] if same else max(found.values(), default=-1) + 1
    return found


def _nearest_holder(feature: int, pivot: PivotSolution, frames: int) -> IntArray:
    """For each frame (n,) the index of the body with the feature that has the nearest frame."""
    distance, holder = np.full(frames, np.inf), np.zeros(frames, dtype=np.intp)
    for index, body in enumerate(pivot.bodies):
        if feature not in body.features:
            continue
        right = np.searchsorted(body.frames, np.arange(frames)).clip(1, max(len(body.frames) - 1, 1))
        around = body.frames[np.stack([right - 1, right.clip(max=len(body.frames) - 1)])]
        own = np.abs(around - np.arange(frames)).min(axis=0)
        holder[own < distance] = index
        distance = np.minimum(distance, own)
    return holder


def _in_columns(
    tracks: FeatureTracks,
    pivot: PivotSolution,
    labels: list[str],
    source: IntArray,
    kept: NDArray[np.bool_],
    columns: list[IntArray],
) -> tuple[FeatureTracks, PivotSolution]:
    """Tracks and solution with columns `source`, the observations kept (n, m'), and the bodies' features `columns`."""
    position = np.where(kept[..., None], tracks.position[:, source], np.nan)
    covariance = tracks.covariance
    if covariance is not None:
        covariance = np.where(kept[..., None, None], covariance[:, source], np.nan)
    bodies = [replace(body, features=own) for body, own in zip(pivot.bodies, columns, strict=True)]
    observations = pivot.observations.features(source)
    return replace(tracks, position=position, labels=tuple(labels), covariance=covariance), replace(
        pivot,
        inliers=pivot.inliers[:, source] & kept,
        solution=replace(pivot.solution, bodies=tuple(bodies)),
        observations=observations.weighted(observations.weight * kept),
    )
