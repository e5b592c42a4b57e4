"""The noise of free attitudes as their rotation shows it, which assumes only that the body rotates smoothly.

A feature that is displaced by a few standard deviations turns a body of few features, and nothing else shows it than
the frames before and after.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from baryscope.estimator.adjustment.frame_shifts import FrameShifts, shifts_in
from baryscope.estimator.adjustment.normal_equations import attitude_covariances, attitude_information
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.geometry.so3 import exp_rotation, log_rotation
from baryscope.estimator.registration.body import Body
from baryscope.estimator.registration.intervals import sampling_interval
from baryscope.estimator.registration.noise import MEDIAN

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

REACH = 6  # attitudes before and after to which a rotation is fitted
FARTHEST, FARTHEST_TURN = (
    12,
    0.5,
)  # sampling intervals to them, at most, or in slow rotations as many as turn by this, rad
MORE_NEIGHBOURS = 4  # than the degree, at least
DEGREES = 2, 4  # in time, of the rotation fitted: the next where the last does not describe it
LIMIT = 22.0  # χ² of three degrees of freedom, beyond which an attitude strays: 1 in 15,000
ROUGH = 3.0  # times the median, from which the rotation is too fast to be fitted
AROUND = 41  # attitudes whose median χ² tells how well the fits describe the rotation
FLIP = 1.0  # rad, by which an attitude beside others is turned only where its labels are exchanged
ROUNDS = 4  # of the fit's robust weights
MIN_SHARED = 3  # features, by which the axes of bodies are known to each other
ALIKE = 0.2  # rms distance between points of two bodies over their distance from a line: more are not the same points


@dataclass(frozen=True, eq=False)
class _AttitudeSeries:
    """Attitudes (n, 3, 3) of one set of axes, their covariances (n, 3, 3), rad², and times (n,) in sampling intervals.

    In time, not in frames, the rotation is smooth: cameras that look in bursts, or lose sight, have none between.
    """

    time: FloatArray
    attitude: FloatArray
    covariance: FloatArray

    @classmethod
    def of(
        cls, body: Body, observations: Observations, time: FloatArray, variance: float, shifts: FrameShifts | None
    ) -> "_AttitudeSeries":
        """The attitudes of a body; time (n,) of all frames, s."""
        own = observations.features(body.features).frames(body.frames)
        own_shifts = shifts_in(shifts, body.frames)
        information = attitude_information(own, body.attitude, body.points, own_shifts)
        passed = (time[body.frames] - time[0]) / sampling_interval(time)
        return cls(passed, body.attitude, attitude_covariances(information, variance))

    def part(self, kept: IntArray) -> "_AttitudeSeries":
        """Some of the attitudes, by their indices (k,)."""
        return _AttitudeSeries(self.time[kept], self.attitude[kept], self.covariance[kept])

    def turned(self, into: FloatArray, variance: float) -> "_AttitudeSeries":
        """The same attitudes of other axes, into which a rotation (3, 3) of this variance, rad², leads from these."""
        covariance = into @ self.covariance @ into.T + variance * np.eye(3)
        return _AttitudeSeries(self.time, self.attitude @ into.T, covariance)


def strays(
    bodies: Sequence[Body],
    observations: Observations,
    time: FloatArray,
    variance: float,
    shifts: FrameShifts | None = None,
) -> list[BoolArray]:
    """Which attitudes of each body are far from a rotation fitted to those near, (n,).

    Bodies that share enough features have their attitudes compared with each other's: of few frames, as those in which
    some features are others, there are no neighbours.
    observations (n, m), with robust weights, at times (n,) in s; variance: of an observation of weight 1; shifts:
    of the frames.
    """
    found = [np.zeros(len(body.frames), dtype=bool) for body in bodies]
    for group, turning in _together(bodies, observations, time, variance, shifts):
        order = np.argsort(turning.time, kind="stable")
        flipped = _flipped(turning.time[order], turning.attitude[order])
        stray = np.zeros(len(order), dtype=bool)
        stray[order[flipped]] = True
        order = order[~flipped]
        departures = _departures(turning.part(order))
        squared, tested = departures.squares, departures.tested
        if tested.any():
            around = _running_medians(squared, AROUND)
            usual = np.maximum(np.median(squared[tested]), around) / MEDIAN
            stray[order] = tested & (squared > LIMIT * np.maximum(usual, 1.0))
        if stray.any():
            ends = np.cumsum([len(bodies[index].frames) for index in group])
            for index, own in zip(group, np.split(stray, ends[:-1]), strict=True):
                found[index] = own
    return found


def _together(
    bodies: Sequence[Body], observations: Observations, time: FloatArray, variance: float, shifts: FrameShifts | None
) -> Iterator[tuple[list[int], _AttitudeSeries]]:
    """Groups of bodies by their indices, and the attitudes of the axes of the first, one body's after the other's."""
    left = sorted(range(len(bodies)), key=lambda index: -len(bodies[index].frames))
    while left:
        first, rest = left[0], []
        group, parts = [first], [_AttitudeSeries.of(bodies[first], observations, time, variance, shifts)]
        for index in left[1:]:
            into = _into_axes(bodies[first], bodies[index], observations)
            if into is None:
                rest.append(index)
            else:
                group.append(index)
                parts.append(_AttitudeSeries.of(bodies[index], observations, time, variance, shifts).turned(*into))
        columns = zip(*((part.time, part.attitude, part.covariance) for part in parts), strict=True)
        yield group, _AttitudeSeries(*map(np.concatenate, columns))
        left = rest


def _into_axes(first: Body, second: Body, observations: Observations) -> tuple[FloatArray, float] | None:
    """The rotation (3, 3) from a second body's axes into those of the first, and its variance in rad², by features of
    both; None if they are too few, or nearly in a line, or not the same points.
    """
    shared, in_first, in_second = np.intersect1d(first.features, second.features, return_indices=True)
    seen = [observations.weight[np.ix_(body.frames, shared)].sum(axis=0) for body in (first, second)]
    weight = np.minimum(*seen)
    if np.count_nonzero(weight) < MIN_SHARED:
        return None
    target, moved = first.points[in_first], second.points[in_second]
    fit = align(target[None], moved, weight[None])
    residual = target - (moved @ fit.rotation[0].T + fit.translation[0])
    square = float(weight @ np.sum(residual**2, axis=1)) / float(weight.sum())
    variance = square / max(float(fit.spread[0]), 1e-300)
    return (fit.rotation[0], variance) if variance < ALIKE**2 else None


@dataclass(frozen=True, eq=False)
class Departures:
    """How far attitudes are from a rotation fitted to those near, which assumes only that the body rotates smoothly.

    turn (n, 3): rotation vectors in S, rad; expected (n, 3, 3): their covariances, with those of the fits, rad²; tested
    (n,): which have enough neighbours; surer (n,): where the fit is at least as sure as the attitude.
    """

    turn: FloatArray
    expected: FloatArray
    tested: BoolArray
    surer: BoolArray

    @property
    def squares(self) -> FloatArray:
        """χ² (n,) of those that are tested, 0 of the others."""
        squared = np.einsum("ki,ki->k", self.turn, np.linalg.solve(self.expected, self.turn[:, :, None])[:, :, 0])
        return np.where(self.tested, squared, 0.0)

    @property
    def describe(self) -> bool:
        """Whether the fits describe most attitudes: not where the rotation is too fast from frame to frame."""
        return bool(self.tested.any()) and bool(np.median(self.squares[self.tested]) <= ROUGH * MEDIAN)

    @classmethod
    def none_of(cls, count: int) -> "Departures":
        """Those of so many attitudes of which none is tested."""
        none = np.zeros(count, dtype=bool)
        return cls(np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)), none, none)


def departures_of(
    body: Body, observations: Observations, time: FloatArray, variance: float, shifts: FrameShifts | None = None
) -> Departures:
    """The departures of a body's attitudes; arguments as of `strays`.

    None is tested where the rotation from frame to frame is too fast to be fitted.
    """
    found = _departures(_AttitudeSeries.of(body, observations, time, variance, shifts))
    return found if found.describe else Departures.none_of(len(body.frames))


def _gaps(time: FloatArray) -> FloatArray:
    """The time (n - 1,) from each attitude to the next; 1 where two bodies are seen at once."""
    gap = np.diff(time)
    return np.where(gap > 0, gap, 1.0)


def _rates(time: FloatArray, attitude: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The rates (n, 3) from each attitude (n, 3, 3) to the next, rad per sampling interval, the last once more, and
    their medians around.
    """
    rate = log_rotation(np.swapaxes(attitude[:-1], 1, 2) @ attitude[1:]) / _gaps(time)[:, None]
    rate = np.concatenate([rate, rate[-1:]])
    return rate, _running_medians(rate, (2 * REACH - 1, 1))


def _flipped(time: FloatArray, attitude: FloatArray) -> BoolArray:
    """Which attitudes (n, 3, 3), at ascending times, are far from where the rate around leads from those next to them.

    Exchanged labels may turn a body by as much as half a turn, and fit well nevertheless. None where attitudes are too
    noisy, or the rotation too fast, to tell.
    """
    if len(time) < 2 * REACH + 1:
        return np.zeros(len(time), dtype=bool)
    rate, median = _rates(time, attitude)
    gap = _gaps(time)
    near = np.linalg.norm(median[:-1], axis=1) * gap < FLIP  # the body has not turned far since
    departure = np.linalg.norm((rate - median)[:-1], axis=1) * gap
    jump = near & (departure > FLIP)
    if not jump.any() or np.median(departure[near]) > FLIP / 4:
        return np.zeros(len(time), dtype=bool)
    stays = near & ~jump
    jumps = np.append(jump, False) | np.append(False, jump)
    return np.asarray(jumps & ~np.append(stays, False) & ~np.append(False, stays))


def _departures(turning: _AttitudeSeries) -> Departures:
    """The departures (n,) of attitudes, at ascending times.

    The fit is of the lowest degree that describes most attitudes, as it has the least noise.
    """
    found = Departures.none_of(len(turning.time))
    for degree in DEGREES:
        found = _departures_from(turning, degree)
        if not found.tested.any() or found.describe:
            break
    return found


def _departures_from(turning: _AttitudeSeries, degree: int) -> Departures:
    """Departures of attitudes from fits of one degree, at ascending times.

    The rotation vectors from the attitude to the others, less a median rate, are a polynomial in time, by robust least
    squares, whose residuals say how well.
    """
    time, attitude, covariance = turning.time, turning.attitude, turning.covariance
    n, size = len(time), 2 * REACH + 1
    if n < size:
        return Departures.none_of(n)
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    # Neighbours of each attitude; those beyond the ends are the attitude itself, which is not used.
    index = np.pad(np.arange(n), REACH, constant_values=-1)
    near = sliding_window_view(index, size)
    near = np.where(near < 0, np.arange(n)[:, None], near)
    apart = time[near] - time[:, None]
    rate = _rates(time, attitude)[1]
    farthest = max(FARTHEST, FARTHEST_TURN / max(float(np.median(np.linalg.norm(rate, axis=1))), 1e-9))
    used = (apart != 0) & (np.abs(apart) <= farthest)
    there = np.swapaxes(attitude, 1, 2)[:, None] @ attitude[near]
    there = there @ exp_rotation(-apart[:, :, None] * rate[:, None])
    turned = log_rotation(there.reshape(-1, 3, 3)).reshape(n, size, 3)
    step = apart / REACH
    terms = np.stack([step**power for power in range(degree + 1)], axis=2)
    precision = np.where(used, deviation[near] ** -2.0, 0.0)
    total = precision.sum(axis=1)[:, None, None]
    ridge = np.where(total > 0, 1e-9 * total, 1.0) * np.eye(terms.shape[2])
    weight, among = precision, used | ~used.any(axis=1)[:, None]
    for _ in range(ROUNDS):
        weighted = terms * weight[:, :, None]
        inverse = np.linalg.inv(np.swapaxes(weighted, 1, 2) @ terms + ridge)
        coefficients = inverse @ (np.swapaxes(weighted, 1, 2) @ turned)
        squares = np.sum((turned - terms @ coefficients) ** 2, axis=2) * precision
        scale = medians_of(squares, among)
        weight = precision / (1 + squares / (9 * np.maximum(scale, 1e-300))[:, None])
    fitted = inverse[:, 0, 0] / 3
    if degree > DEGREES[0]:  # at the ends it leads far off where it does not describe the rotation, as residuals show
        fitted = fitted * np.maximum(3 * np.nan_to_num(scale) / MEDIAN, 1.0)  # each square is of three axes
    expected = covariance + fitted[:, None, None] * np.eye(3)
    tested = used.sum(axis=1) >= degree + MORE_NEIGHBOURS
    return Departures(coefficients[:, 0], expected, tested, tested & (3 * fitted <= deviation**2))


def medians_of(values: FloatArray, used: BoolArray) -> FloatArray:
    """The medians (n,) of the used ones, of values (n, k); numpy's of what is not NaN takes five times as long."""
    used = used & ~np.isnan(values)
    ordered, count = np.sort(np.where(used, values, np.inf), axis=1), used.sum(axis=1)
    middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2], axis=1)
    found = np.take_along_axis(ordered, middle, axis=1).mean(axis=1)
    return np.asarray(np.where(count > 0, found, np.nan))


def _running_medians(values: FloatArray, size: int | tuple[int, ...]) -> FloatArray:
    """The medians of as many values around each, along each axis; the outermost go on at the ends."""
    from scipy.ndimage import median_filter  # slow to load, and few commands need it

    return np.asarray(median_filter(values, size, mode="nearest"))
