"""From observations to rigid bodies: which features belong together, their shape, and their attitude in each frame.

The frames are cut into intervals. Intervals that share three features that are not collinear belong to one body, also
across gaps, if the shapes agree. Features that return thus connect intervals; replaced features do not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import (
    Interval,
    collinear_features,
    cut_intervals,
    too_few_features,
)
from baryscope.estimator.registration.procrustes import OFF_LINE, register

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHAPE_TOLERANCE = 1e-4  # convergence of an initial shape, relative to its size; it is refined later
COLLINEARITY = 0.03  # second over first singular value of points up to which they count as collinear
MAX_FRAME_STEP = 4  # frames between two with three features, up to which an interval continues
MAX_SHAPE_FRAMES = 400  # frames of an interval that its initial shape is computed from, at most
AGREEMENT = 6.0  # standard deviations by which two shapes of one body may differ at shared features
CHUNK = 8192  # frames aligned at once


@dataclass(frozen=True, eq=False)
class Registered:
    """Rigid bodies from registration; each body's points have their origin in their centroid.

    origins: for each body its centroid in each of its frames, (n, 3) in C, m; noise: standard deviation of a
    coordinate, m.
    """

    bodies: tuple[Body, ...]
    origins: tuple[FloatArray, ...]
    noise: float


@dataclass(eq=False)
class _Shape:
    """A shape being assembled: its features' points in its own axes, m, and how often each feature is seen."""

    points: dict[int, FloatArray]
    counts: dict[int, int]
    intervals: list[Interval]


def find_bodies(position: FloatArray, used: BoolArray) -> Registered:
    """The rigid bodies in position (n, m, 3) in C, m, and the noise of a coordinate from the residuals of registration.

    used (n, m) selects the observations.

    Raises:
        ComputationError: no frame sees three features, or they are collinear in all frames.
    """
    enough = np.nonzero(used.sum(axis=1) >= 3)[0]
    intervals = (
        _connected_intervals(position[enough], used[enough], np.diff(enough) > MAX_FRAME_STEP) if len(enough) else []
    )
    if not intervals:
        raise too_few_features(used)
    shapes, squares, dof = [], 0.0, 0.0
    for interval in intervals:
        columns = np.array(interval.features)
        rows = enough[interval.start : interval.stop]
        interval = Interval(int(rows[0]), int(rows[-1]) + 1, interval.features)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MAX_SHAPE_FRAMES)).astype(int))]
        block = np.where(used[np.ix_(rows, columns)][..., None], position[np.ix_(rows, columns)], np.nan)
        fitted = register(block, tolerance=SHAPE_TOLERANCE)
        if not fitted.valid.any():
            continue
        values = max(3 * int(np.isfinite(block[..., 0]).sum()) - 6 * len(rows) - 3 * len(columns) + 6, 0)
        squares, dof = squares + fitted.rms**2 * values, dof + values
        seen = used[interval.frames][:, columns].sum(axis=0)
        placed = [index for index, point in enumerate(fitted.shape) if np.isfinite(point[0])]
        shapes.append(
            _Shape(
                {int(columns[index]): fitted.shape[index] for index in placed},
                {int(columns[index]): int(seen[index]) for index in placed},
                [interval],
            )
        )
    if not shapes:
        raise collinear_features()
    noise = float(np.sqrt(squares / max(dof, 1)))
    with_attitudes = [_with_attitudes(shape, position, used, noise) for shape in _merged(shapes, noise)]
    found = [(body, origin) for body, origin in with_attitudes if len(body.frames)]
    if not found:
        raise collinear_features()
    bodies, origins = zip(*found, strict=True)
    return Registered(bodies, origins, noise)


def _connected_intervals(position: FloatArray, used: BoolArray, gaps: BoolArray) -> list[Interval]:
    """The intervals, cut where the features that a frame shares with the first frame are collinear."""
    pending, done = list(reversed(cut_intervals(used, gaps))), []
    while pending:
        interval = pending.pop()
        first, seen = position[interval.start], used[interval.frames]
        shared = seen & seen[0]
        if (shared == shared[0]).all():
            done.append(interval)
            continue
        patterns, which = np.unique(np.packbits(shared, axis=1), axis=0, return_inverse=True)
        members = np.unpackbits(patterns, axis=1, count=shared.shape[1]).astype(bool)
        collinear = np.array([_are_collinear(first[pattern]) for pattern in members])[which.ravel()]
        if not collinear.any() or collinear[0]:
            done.append(interval)
            continue
        stop = int(np.argmax(collinear))
        features = np.nonzero(seen[:stop].any(axis=0))[0]
        done.append(Interval(interval.start, interval.start + stop, tuple(features.tolist())))
        rest = cut_intervals(seen[stop:], gaps[interval.start + stop : interval.stop - 1])
        shift = interval.start + stop
        pending += [Interval(one.start + shift, one.stop + shift, one.features) for one in reversed(rest)]
    return done


def _are_collinear(points: FloatArray) -> bool:
    """Whether points (m, 3) lie so near a line that the rotation about it is poorly determined."""
    lengths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(lengths[1] <= COLLINEARITY * lengths[0])


def _merged(shapes: Sequence[_Shape], noise: float) -> list[_Shape]:
    """Shapes, merged if two share three features that are not collinear; starts with the most often seen one."""
    pending = sorted(shapes, key=lambda shape: -sum(shape.counts.values()))
    done: list[_Shape] = []
    while pending:
        whole = pending.pop(0)
        joined = True
        while joined:
            joined = False
            for other in list(pending):
                if _merge(whole, other, noise):
                    pending.remove(other)
                    joined = True
        done.append(whole)
    return done


def _merge(whole: _Shape, other: _Shape, noise: float) -> bool:
    """Merge `other` into `whole` if their shared features determine the rigid motion between them and agree.

    Returns whether they were merged.
    """
    shared = sorted(whole.points.keys() & other.points.keys())
    if len(shared) < 3:
        return False
    a = np.array([whole.points[index] for index in shared])
    b = np.array([other.points[index] for index in shared])
    seen = np.array([1 / (1 / whole.counts[index] + 1 / other.counts[index]) for index in shared])
    fitted = align(a[None], b[None], seen[None])
    deviation = noise / np.sqrt(seen)
    if fitted.spread[0] < (AGREEMENT * deviation.max()) ** 2 + 1e-18 * float(np.sum(a**2)):
        return False
    R, t = fitted.rotation[0], fitted.translation[0]
    residual = np.linalg.norm(b @ R.T + t - a, axis=1)
    # The factor 3: a shape from few frames is less accurate than its noise says, as its attitudes have errors, too.
    if np.any(residual > AGREEMENT * 3 * deviation + 1e-9 * np.abs(a).max()):
        return False
    for index, point in other.points.items():
        moved = R @ point + t
        if index in whole.points:
            share = other.counts[index] / (other.counts[index] + whole.counts[index])
            moved = (1 - share) * whole.points[index] + share * moved
        whole.points[index] = moved
        whole.counts[index] = whole.counts.get(index, 0) + other.counts[index]
    whole.intervals.extend(other.intervals)
    return True


def _with_attitudes(shape: _Shape, position: FloatArray, used: BoolArray, noise: float) -> tuple[Body, FloatArray]:
    """The shape as a body with its attitude in all frames of its intervals, and its centroid there, (n, 3) in C, m.

    Frames whose features are nearly collinear are left out.
    """
    features = np.array(sorted(shape.points), dtype=np.intp)
    points = np.array([shape.points[index] for index in features])
    points = points - points.mean(axis=0)
    shape.intervals.sort(key=lambda interval: interval.start)
    frames = np.concatenate([np.arange(interval.start, interval.stop) for interval in shape.intervals])
    frames = frames[used[np.ix_(frames, features)].sum(axis=1) >= 3]
    attitudes, translations, kept = [], [], []
    for first in range(0, len(frames), CHUNK):
        rows = frames[first : first + CHUNK]
        weight = used[np.ix_(rows, features)].astype(np.float64)
        fitted = align(position[np.ix_(rows, features)], points, weight)
        determined = fitted.spread > max((OFF_LINE * noise) ** 2, 1e-18 * float(np.sum(points**2)))
        attitudes.append(fitted.rotation[determined])
        translations.append(fitted.translation[determined])
        kept.append(rows[determined])
    body = Body(features, np.concatenate(kept), points, np.concatenate(attitudes), tuple(shape.intervals))
    return body, np.concatenate(translations)
