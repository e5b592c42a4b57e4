"""Frames that belong to a body already known: their features are those of the body, however few they are.

An interval of a few frames gives no shape of its own that could be compared. Its frames are aligned with a body
instead; where they fit, they and their other features are parts of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS, Alignment, align
from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.registration.intervals import Interval
from baryscope.estimator.registration.procrustes import ADEQUATE, OFF_LINE

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

AGREEMENT = 6.0  # standard deviations by which two shapes of one body may differ at shared features
SHAPE_SHARE = 3.0  # error of a shape from few frames, whose attitudes have errors, too, over that of its points alone
CHUNK = 8192  # frames aligned at once
MAX_FRAMES = 2000  # frames from which a shape that was put together is refined, at most
MAX_ROUNDS = 30  # of poses and the shape by turns


@dataclass(frozen=True, eq=False)
class Sightings:
    """position (n, m, 3) in C, m; used (n, m): which observations count; noise: deviation of a coordinate, m."""

    position: FloatArray
    used: BoolArray
    noise: float


@dataclass(eq=False)
class Shape:
    """A shape being assembled: its features' points in its own axes, m, and how often each feature is seen."""

    points: dict[int, FloatArray]
    counts: dict[int, int]
    intervals: list[Interval]

    @property
    def size(self) -> int:
        """The number of observations."""
        return sum(self.counts.values())

    def arrays(self) -> tuple[IntArray, FloatArray]:
        """The features (m,), ascending, and their points (m, 3) in m."""
        features = np.array(sorted(self.points), dtype=np.intp)
        return features, np.array([self.points[index] for index in features.tolist()])

    def variances(self, noise: float) -> FloatArray:
        """The variances (m,) of a coordinate of these points, m², for the standard deviation of an observation's."""
        return noise**2 / np.maximum([self.counts[index] for index in sorted(self.points)], 1)


def gathered(whole: Shape, pending: list[Interval], sightings: Sightings) -> list[Interval]:
    """Add to `whole` those of the pending intervals that fit it, with their new features; returns the others."""
    while pending:
        features, points = whole.arrays()
        rows, of_interval = frames_of(pending)
        enough = sightings.used[np.ix_(rows, features)].sum(axis=1) >= FEWEST_POINTS
        rows, of_interval = rows[enough], of_interval[enough]
        aligned, determined = aligned_frames(sightings, rows, features, points, whole.variances(sightings.noise))
        rows, of_interval = rows[determined], of_interval[determined]
        fits = _fitting(whole, sightings, rows, of_interval, aligned, len(pending))
        if not fits.any():
            return pending
        kept = fits[of_interval]
        _add_features(whole, sightings, rows[kept], (aligned[0][kept], aligned[1][kept]))
        whole.intervals += [one for one, fit in zip(pending, fits, strict=True) if fit]
        pending = [one for one, fit in zip(pending, fits, strict=True) if not fit]
    return pending


def grown_from(pending: list[Interval], sightings: Sightings) -> tuple[Shape, list[Interval]]:
    """The shape that grows from the first frame of the longest of the pending intervals, and the intervals left."""
    seed = max(pending, key=lambda interval: interval.length)
    features = np.nonzero(sightings.used[seed.start])[0].tolist()
    whole = Shape({index: sightings.position[seed.start, index] for index in features}, dict.fromkeys(features, 1), [])
    left = gathered(whole, pending, sightings)
    if whole.intervals:
        refined_shape(whole, sightings)
    return whole, [interval for interval in left if interval != seed]


def frames_of(intervals: list[Interval]) -> tuple[IntArray, IntArray]:
    """The frames (k,) of intervals, one after the other, and the index of each frame's interval (k,)."""
    frames = [np.arange(one.start, one.stop) for one in intervals]
    return np.concatenate(frames), np.repeat(np.arange(len(intervals)), [one.length for one in intervals])


def aligned_frames(
    sightings: Sightings, rows: IntArray, features: IntArray, points: FloatArray, variances: FloatArray
) -> tuple[tuple[FloatArray, FloatArray], BoolArray]:
    """Attitudes (k, 3, 3) R_C_S and origins (k, 3) in C, m, of points (m, 3) in S in the frames `rows` that give one.

    variances (m,): of the points' coordinates, m². Returns these, and which of the rows do: those whose features lie
    off a line by OFF_LINE, and by more than the points' own noise.
    """
    attitudes, translations, kept = [np.zeros((0, 3, 3))], [np.zeros((0, 3))], [np.zeros(0, dtype=bool)]
    for first in range(0, len(rows), CHUNK):
        block = np.ix_(rows[first : first + CHUNK], features)
        seen = sightings.used[block]
        found: Alignment = align(sightings.position[block], points, seen.astype(np.float64))
        by_noise = 2 * seen @ variances + 3 * 2 * np.sqrt(seen @ variances**2)  # 3σ of what noise alone would show
        determined = _moments(seen, points) > (OFF_LINE * sightings.noise) ** 2 + by_noise
        determined &= found.spread > 1e-18 * float(np.sum(points**2))
        attitudes.append(found.rotation[determined])
        translations.append(found.translation[determined])
        kept.append(determined)
    return (np.concatenate(attitudes), np.concatenate(translations)), np.concatenate(kept)


def _moments(seen: BoolArray, points: FloatArray) -> FloatArray:
    """The sum of squared distances (k,) from a line, m², of those of the points (m, 3) that frames see (k, m).

    Of the shape, not of the positions seen: those whose noise lies off the line by chance would be chosen.
    """
    if (seen == seen[:1]).all():
        weight, which = seen[:1].astype(np.float64), np.zeros(len(seen), dtype=np.intp)
    else:
        patterns, which = np.unique(np.packbits(seen, axis=1), axis=0, return_inverse=True)
        weight = np.unpackbits(patterns, axis=1, count=seen.shape[1]).astype(np.float64)
    mean = (weight @ points) / np.maximum(weight.sum(axis=1), 1.0)[:, None]
    outer = (points[:, :, None] * points[:, None]).reshape(-1, 9)
    scatter = (weight @ outer).reshape(-1, 3, 3) - weight.sum(axis=1)[:, None, None] * mean[:, :, None] * mean[:, None]
    values = np.linalg.eigvalsh(scatter)
    return np.asarray((values[:, 0] + values[:, 1])[which.ravel()])


def _fitting(
    whole: Shape,
    sightings: Sightings,
    rows: IntArray,
    of_interval: IntArray,
    aligned: tuple[FloatArray, FloatArray],
    count: int,
) -> BoolArray:
    """Which of `count` intervals fit the shape: those whose mean residual of each feature is small, (count,)."""
    features, points = whole.arrays()
    rotation, translation = aligned
    block = np.ix_(rows, features)
    weight = sightings.used[block].astype(np.float64)
    residual = np.where(weight[..., None] > 0, sightings.position[block] - translation[:, None], 0.0) @ rotation
    residual = weight[..., None] * (residual - points)
    sums, seen = np.zeros((count, len(features), 3)), np.zeros((count, len(features)))
    np.add.at(sums, of_interval, residual)
    np.add.at(seen, of_interval, weight)
    known = np.array([whole.counts[index] for index in features.tolist()])
    variance = sightings.noise**2 * (1 / np.maximum(seen, 1.0) + SHAPE_SHARE**2 / np.maximum(known, 1))
    mean = np.linalg.norm(sums, axis=2) / np.maximum(seen, 1.0)
    far = mean > AGREEMENT * np.sqrt(variance) + 1e-9 * np.abs(points).max()
    aligned_at_all = np.bincount(of_interval, minlength=count) > 0
    return np.asarray(aligned_at_all & ~far.any(axis=1))


def _add_features(whole: Shape, sightings: Sightings, rows: IntArray, aligned: tuple[FloatArray, FloatArray]) -> None:
    """Add the observations in the frames `rows`, of known attitudes and origins, to the points of the shape."""
    rotation, translation = aligned
    seen = sightings.used[rows]
    moved = np.where(seen[..., None], sightings.position[rows] - translation[:, None], 0.0) @ rotation
    moved = np.where(seen[..., None], moved, 0.0)
    count, total = seen.sum(axis=0), moved.sum(axis=0)
    for index in np.nonzero(count)[0].tolist():
        before = whole.counts.get(index, 0)
        known = before * whole.points[index] if before else 0.0
        whole.counts[index] = before + int(count[index])
        whole.points[index] = (known + total[index]) / whole.counts[index]


def refined_shape(whole: Shape, sightings: Sightings) -> None:
    """Bring the points of a shape that was put together to the mean over its frames, by Procrustes' iteration."""
    (features, points), variances = whole.arrays(), whole.variances(sightings.noise)
    rows, _ = frames_of(whole.intervals)
    rows = rows[sightings.used[np.ix_(rows, features)].sum(axis=1) >= FEWEST_POINTS]
    rows = rows[evenly_spaced(len(rows), MAX_FRAMES)]
    for _ in range(MAX_ROUNDS):
        (rotation, translation), determined = aligned_frames(sightings, rows, features, points, variances)
        block = np.ix_(rows[determined], features)
        weight = sightings.used[block].astype(np.float64)
        moved = np.where(weight[..., None] > 0, sightings.position[block] - translation[:, None], 0.0) @ rotation
        count = weight.sum(axis=0)
        mean = (weight[..., None] * moved).sum(axis=0) / np.maximum(count, 1.0)[:, None]
        change = np.where(count[:, None] > 0, mean - points, 0.0)
        points = points + change
        if np.abs(change).max() <= max(
            ADEQUATE * sightings.noise / np.sqrt(max(len(rows), 1)), 1e-9 * np.abs(points).max()
        ):
            break
    whole.points = dict(zip(features.tolist(), points, strict=True))
