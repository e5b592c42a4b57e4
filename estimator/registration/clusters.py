"""From observations to rigid bodies: which features belong together, their shape, and their attitude in each frame.

The frames are cut into intervals. Intervals that share three features that are not collinear belong to one body, also
across gaps, if the shapes agree. Features that return thus connect intervals; replaced features do not. Intervals too
short for a shape of their own belong to the body that their frames fit (`gathering`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.alignment import FEWEST_POINTS, align
from baryscope.estimator.geometry.evenly import evenly_spaced
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.flips import steady
from baryscope.estimator.registration.gathering import (
    AGREEMENT,
    SHAPE_SHARE,
    Shape,
    Sightings,
    aligned_frames,
    frames_of,
    gathered,
    grown_from,
    refined_shape,
)
from baryscope.estimator.registration.intervals import (
    Interval,
    collinear_features,
    cut_intervals,
    too_few_features,
)
from baryscope.estimator.registration.noise import noise_of_distances, pooled_noise
from baryscope.estimator.registration.procrustes import OFF_LINE, Registration, register

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHAPE_TOLERANCE = 1e-4  # convergence of an initial shape, relative to its size; it is refined later
COLLINEARITY = 0.03  # second over first singular value of points up to which they count as collinear
MAX_FRAME_STEP = 4  # frames between two with three features, up to which an interval continues
MAX_SHAPE_FRAMES = 400  # frames of an interval that its initial shape is computed from, at most
MAX_SEEDS = 20  # bodies tried from intervals that have no shape of their own, at most
MIN_FRAMES = 10  # a body of fewer frames tells nothing of the centre of mass, and is left out if there is a longer one
MISLABELLED = 0.05  # share of frames in bodies that contradict a longer one, up to which it is their labels that err


@dataclass(frozen=True, eq=False)
class Registered:
    """Rigid bodies from registration; each body's points have their origin in their centroid.

    origins: for each body its centroid in each of its frames, (n, 3) in C, m; noise: standard deviation of a
    coordinate, m, and values: the degrees of freedom that tell it.
    """

    bodies: tuple[Body, ...]
    origins: tuple[FloatArray, ...]
    noise: float
    values: float = 0.0

    @property
    def in_line(self) -> bool:
        """Whether the features of all bodies are in a line: third axis; the others are arbitrary in each frame."""
        return all(body.in_line for body in self.bodies)


def find_bodies(position: FloatArray, used: BoolArray, time: FloatArray | None = None) -> Registered:
    """The rigid bodies in position (n, m, 3) in C, m, and the noise of a coordinate from the residuals of registration.

    used (n, m) selects the observations; time (n,) in s, of steady steps unless given. Bodies of fewer than MIN_FRAMES
    frames are left out if there is a longer one, and so are those of a few frames whose labels err.

    Raises:
        ComputationError: no frame sees three features, or they are collinear in all frames.
    """
    enough = np.nonzero(used.sum(axis=1) >= FEWEST_POINTS)[0]
    intervals = (
        _connected_intervals(position[enough], used[enough], np.diff(enough) > MAX_FRAME_STEP) if len(enough) else []
    )
    if not intervals:
        raise too_few_features(used)
    # Short intervals take the most time, and have shapes of little use: they are gathered by the long ones.
    long = [interval for interval in intervals if interval.length >= MIN_FRAMES] or intervals
    chosen, registrations, blocks = set(long), [], []
    for interval in long:
        rows = enough[interval.frames]
        rows = rows[evenly_spaced(len(rows), MAX_SHAPE_FRAMES)]
        block = np.ix_(rows, np.array(interval.features))
        blocks.append(np.where(used[block][..., None], position[block], np.nan))
        registrations.append(register(blocks[-1], tolerance=SHAPE_TOLERANCE))
    pooled = pooled_noise(registrations, blocks)
    told = noise_of_distances(position, used) if pooled is None else pooled
    noise, sightings = told.deviation, Sightings(position, used, told.deviation)
    shapes, loose = [], [_placed(interval, enough) for interval in intervals if interval not in chosen]
    for interval, fitted in zip(long, registrations, strict=True):
        placed = _placed(interval, enough)
        if (fitted.moment > max((OFF_LINE * noise) ** 2, (1e-9 * fitted.radius) ** 2)).any():
            shapes.append(_shape(placed, fitted, used))
        else:
            loose.append(placed)
    whole = _assembled(shapes, loose, sightings)
    steps = typical_steps(len(position), time)
    with_attitudes = [_with_attitudes(shape, sightings, steps) for shape in whole]
    longest = max((len(body.frames) for body, _ in with_attitudes), default=0)
    if not longest:
        raise collinear_features()
    found = [(body, origin) for body, origin in with_attitudes if len(body.frames) >= min(MIN_FRAMES, longest)]
    bodies, origins = zip(*_rightly_labelled(found), strict=True)
    return Registered(bodies, origins, noise, told.values)


def _rightly_labelled(found: list[tuple[Body, FloatArray]]) -> list[tuple[Body, FloatArray]]:
    """The bodies, with what else is found of them, without those that contradict longer ones, if these are few frames.

    A body has one shape. Three features that are not in a line and have another one in some frames are displaced or
    have wrong labels there: attitudes by them tell nothing, and have led paths astray that all other frames told.
    """
    bodies = [body for body, _ in found]
    wrong = [any(_contradicts(body, other) for other in bodies) for body in bodies]
    frames = np.array([len(body.frames) for body in bodies])
    if frames[wrong].sum() > MISLABELLED * frames.sum():
        return found
    return [one for one, contradicts in zip(found, wrong, strict=True) if not contradicts]


def _contradicts(body: Body, longer: Body) -> bool:
    """Whether a body shares features with a longer one that determine the rigid motion between them: it has another
    shape, as they would be one body else.
    """
    shared = np.isin(longer.features, body.features)
    if len(body.frames) >= len(longer.frames) or np.count_nonzero(shared) < FEWEST_POINTS:
        return False
    return not _are_collinear(longer.points[shared])


def _placed(interval: Interval, frames: NDArray[np.intp]) -> Interval:
    """An interval of some frames as one of all."""
    return Interval(int(frames[interval.start]), int(frames[interval.stop - 1]) + 1, interval.features)


def _shape(interval: Interval, fitted: Registration, used: BoolArray) -> Shape:
    """The shape that the registration of an interval found."""
    columns = np.array(interval.features)
    seen = used[interval.frames][:, columns].sum(axis=0)
    known = [index for index, point in enumerate(fitted.shape) if np.isfinite(point[0])]
    return Shape(
        {int(columns[index]): fitted.shape[index] for index in known},
        {int(columns[index]): int(seen[index]) for index in known},
        [interval],
    )


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


def _assembled(shapes: Sequence[Shape], loose: list[Interval], sightings: Sightings) -> list[Shape]:
    """Bodies from the shapes of intervals and from those without one, `loose`; the most often seen one grows first."""
    pending = sorted(shapes, key=lambda shape: -shape.size)
    done: list[Shape] = []
    while pending:
        whole = pending.pop(0)
        parts = len(whole.intervals)
        size = 0
        while size < whole.size:
            size = whole.size
            for other in pending:
                if _length(other) >= MIN_FRAMES and _merge(whole, other, sightings.noise):
                    other.intervals = []
            candidates = [interval for shape in pending for interval in shape.intervals] + loose
            left = set(gathered(whole, candidates, sightings))
            loose = [interval for interval in loose if interval in left]
            for shape in pending:
                shape.intervals = [interval for interval in shape.intervals if interval in left]
            pending = [shape for shape in pending if shape.intervals]
        if len(whole.intervals) > parts:
            refined_shape(whole, sightings)
        done.append(whole)
    for _ in range(MAX_SEEDS if loose else 0):
        whole, loose = grown_from(loose, sightings)
        if _length(whole) >= MIN_FRAMES:
            done.append(whole)
        if not loose:
            break
    return done


def _length(shape: Shape) -> int:
    """The number of frames of a shape's intervals."""
    return sum(interval.length for interval in shape.intervals)


def _merge(whole: Shape, other: Shape, noise: float) -> bool:
    """Merge `other` into `whole` if their shared features determine the rigid motion between them and agree.

    Returns whether they were merged.
    """
    shared = sorted(whole.points.keys() & other.points.keys())
    if len(shared) < FEWEST_POINTS:
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
    if np.any(residual > AGREEMENT * SHAPE_SHARE * deviation + 1e-9 * np.abs(a).max()):
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


def typical_steps(frames: int, time: FloatArray | None) -> FloatArray:
    """The time (n,) of the frames in steps of the median length; their numbers without one."""
    return np.arange(frames, dtype=np.float64) if time is None or frames < 2 else time / np.median(np.diff(time))


def _with_attitudes(shape: Shape, sightings: Sightings, steps: FloatArray) -> tuple[Body, FloatArray]:
    """The shape as a body with its attitude in all frames of its intervals, and its centroid there, (n, 3) in C, m.

    Frames whose features are nearly collinear are left out, and those whose attitude is off the rotation. steps (n,):
    the time of all frames in typical steps.
    """
    features, points = shape.arrays()
    points = points - points.mean(axis=0)
    shape.intervals.sort(key=lambda interval: interval.start)
    frames, _ = frames_of(shape.intervals)
    frames = frames[sightings.used[np.ix_(frames, features)].sum(axis=1) >= FEWEST_POINTS]
    variances = shape.variances(sightings.noise)
    (attitude, origin), determined = aligned_frames(sightings, frames, features, points, variances)
    frames = frames[determined]
    kept = steady(steps[frames], attitude)
    return Body(features, frames[kept], points, attitude[kept], tuple(shape.intervals)), origin[kept]
