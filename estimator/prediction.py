"""Position and velocity of the centre of mass, or of a point of the body, at any time: before, in gaps and ahead.

A predictor holds the posterior of all unknowns together: those of the rotation and of the path, u, and the points,
whose deviation for a change δu is −N δu beside an own one. What of it is a point's is in `turning`. Before the first
observation and after the last, process and torque noise add what they cause from there, and a smooth path what is not
told of how it goes on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from baryscope.estimator.dynamics.growth import path_growth
from baryscope.estimator.dynamics.inertia import of_a_body
from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA, SHORT_NODE_ANGLE, Attitudes, Rotation
from baryscope.estimator.dynamics.torque import LastingTorque
from baryscope.estimator.geometry.gauge import attached_turn
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.limits import LATEST
from baryscope.estimator.paths.doubtful_path import left_out
from baryscope.estimator.paths.extrapolated_path import extrapolated, untold_of
from baryscope.estimator.paths.forces import lasting, untold_firings
from baryscope.estimator.paths.nonlinear_path import End, nonlinear_in
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.process_noise import ProcessNoisePath, free_modes, noise_in, wave_numbers
from baryscope.estimator.turning import TurningPoint, carried, curved
from baryscope.estimator.widening import Widening
from baryscope.models.arguments import array_of
from baryscope.models.errors import InputError
from baryscope.models.words import brief

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
Point = str | Sequence[float] | FloatArray | None

CHUNK = 4000  # times at once: a few hundred megabytes
BEYOND = 8  # modes of process noise that count, over those that are estimated
FARTHEST = 1e4  # m from the centroid of the features
MANY = 500  # times, between which the variance of what is untold of a velocity is interpolated


@dataclass(frozen=True, eq=False)
class Prediction:
    """Position and velocity of a point at n times, in C.

    time (n,) in s; position (n, 3) in m; velocity (n, 3) in m/s; covariance (n, 6, 6) of both, in m and s.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray

    __repr__ = brief

    @classmethod
    def of(cls, time: FloatArray, state: FloatArray, covariance: FloatArray) -> "Prediction":
        """The prediction of position and velocity (n, 6), with their covariance (n, 6, 6)."""
        return cls(time, state[:, :3], state[:, 3:], covariance)

    def widened(self, by: Widening, begin: float, end: float) -> "Prediction":
        """With a wider covariance; begin, end: of the tracks, s."""
        return replace(self, covariance=by.of_both(self.covariance, self.time, begin, end))


class Predictor(Protocol):
    """What a method leaves for predictions."""

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """The prediction of the centre of mass (None), or of a point, at times (n,) in s; see `Estimate.predict`."""
        ...


@dataclass(frozen=True, eq=False)
class PredictedPath:
    """The posterior of a path over the tracks from begin to end, in s.

    x (p,) and its covariance (p, p); density of the process noise, m²/s³, the mean over its posterior.
    """

    path: Path
    x: FloatArray
    covariance: FloatArray
    begin: float
    end: float
    density: float = 0.0

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`.

        Raises:
            InputError: a point is asked for, without a rotation.
        """
        if point is not None:
            raise InputError(
                "point: pivot has attitudes in its frames only, not between and after them, expected ml or ekf"
            )
        state, covariance = _by_chunks(self._chunk, time)
        return Prediction.of(time, state, covariance + self.added(time))

    def _chunk(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6), and their covariance (n, 6, 6) by that of x."""
        state, by_x, rest = self.sampled(time)
        return state, by_x @ self.covariance @ np.swapaxes(by_x, 1, 2) + rest

    def sampled(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position and velocity (n, 6) in C, their Jacobian (n, 6, p) by x, and what they vary by beside it, (n, 6, 6),
        where a path is not linear in x.
        """
        state, by_x = self._linear(time)
        rest, part = np.zeros((len(time), 6, 6)), nonlinear_in(self.path)
        if part is None:
            return state, by_x, rest
        for origin, away in ((self.begin, time < self.begin), (self.end, time > self.end)):
            if away.any():
                there, by_there = self._linear(np.array([origin]))
                bent = End(origin, there[0], by_there[0], self.x, self.covariance).curvature(part, time[away])
                state[away] += bent.mean
                by_x[away] += bent.slope
                rest[away] = bent.covariance
        return state, by_x, rest

    def _linear(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) and their Jacobian (n, 6, p) by x, of the path as if it were linear in x."""
        place, rate = self._onward.at(time), self._onward.rate_at(time)
        state = np.concatenate([place.position(self.x), rate.position(self.x)], axis=1)
        return state, np.concatenate([place.jacobian, rate.jacobian], axis=1)

    @cached_property
    def _onward(self) -> Path:
        return extrapolated(self.path, self.x, self.covariance)

    def added(self, time: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) of what the tracks do not tell.

        Noise, errors of firings and how a smooth path goes on before and after them, and noise of higher modes.
        """
        noise = noise_in(self.path)
        lasts = 0.0 if noise is None else noise.lasting_variance(self.x, self.density)
        grown = grown_outside(self._onward, (self.density, lasts), self.begin, self.end, time)
        if noise is not None and self.density > 0:
            grown += _by_chunks(lambda part: (_of_higher_modes(noise, self.density, part),), time)[0]
        return grown

    def untold_velocity(self, time: FloatArray) -> FloatArray:
        """The part (n, 3, 3) of `added` in the velocity, (m/s)², at ascending times (n,)."""
        if not self.density > 0:
            return np.zeros((len(time), 3, 3))
        few = time if len(time) <= MANY else np.linspace(time[0], time[-1], MANY)
        variance = np.trace(self.added(few)[:, 3:, 3:], axis1=1, axis2=2) / 3
        return np.asarray(np.interp(time, few, variance)[:, None, None] * np.eye(3))


def _by_chunks(function: Callable[[FloatArray], tuple[FloatArray, ...]], time: FloatArray) -> tuple[FloatArray, ...]:
    """What a function makes of times (n,), for CHUNK of them after the other."""
    parts = [function(time[first : first + CHUNK]) for first in range(0, len(time), CHUNK)]
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True))


def grown_outside(path: Path, noise: tuple[float, float], begin: float, end: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) of position and velocity in C before the tracks' begin and after their end, s, by
    accelerations, errors of firings, forces that the estimate leaves out, and how a smooth path goes on.

    noise: the density of white acceleration, m²/s³, and the variance of one that lasts, (m/s²)².
    """
    density, lasts = noise
    grown = path_growth(path, density, begin, end, time) + lasting(path, lasts, begin, end, time)
    grown += untold_of(path, time) + left_out(path, begin, end, time)
    return np.asarray(grown + untold_firings(path, begin, end, time))


def _of_higher_modes(path: ProcessNoisePath, density: float, time: FloatArray) -> FloatArray:
    """The covariance (n, 6, 6) by modes of process noise that are too many to be estimated: their prior's."""
    span, every = path.end - path.begin, (1 + BEYOND) * path.count
    position, slope = free_modes((time - path.begin) / span, every)
    variance = (density * span**3 / wave_numbers(every) ** 4)[path.count :]
    both = np.stack([position[:, path.count :], slope[:, path.count :] / span], axis=1)
    return np.asarray(np.kron(both * variance @ np.swapaxes(both, 1, 2), np.eye(3)))


@dataclass(frozen=True, eq=False)
class PredictedBody:
    """The joint posterior of a path and a turning body.

    covariance (q, q) of the unknowns u = (those of the rotation, the path's x); labels of the features, points (m, 3)
    in B, m: a change δu changes them by −by_unknowns δu, (3 m, q), beside an own deviation of points_covariance
    (3 m, 3 m) or (m, 3, 3). attached: the features, by index, whose axes and centroid body coordinates refer to;
    torque_density: of the torque noise, rad²/s³.
    """

    path: PredictedPath
    rotation: Rotation
    covariance: FloatArray
    labels: tuple[str, ...]
    points: FloatArray
    points_covariance: FloatArray
    by_unknowns: FloatArray
    attached: IntArray
    torque_density: float = 0.0

    def at(self, time: FloatArray, point: Point) -> Prediction:
        """See `Predictor`.

        Raises:
            InputError: no such feature.
            ComputationError: the rotation cannot be followed so far.
        """
        if point is None:
            return self.path.at(time, None)
        own_covariance = self._own_covariance()
        seen = np.diag(own_covariance)[::3] > 0
        b, by_points = point_in_body(point, self.labels, self.points, seen, self.attached)
        by_unknowns, own = by_points @ self.by_unknowns, by_points @ own_covariance @ by_points.T
        begin, end = self.path.begin, self.path.end
        motion = self.rotation.at(np.array([begin, end]), SHORT_NODE_ANGLE)
        state, covariance = np.empty((len(time), 6)), np.empty((len(time), 6, 6))
        before, after = time < begin, time > end
        for part, one in ((before, motion.at(np.array([begin]))), (after, motion.at(np.array([end])))):
            if part.any():
                away = partial(self._away, self._turning(one, b, by_unknowns, own))
                state[part], covariance[part] = _by_chunks(away, time[part])
        inside = ~before & ~after
        if inside.any():
            state[inside], covariance[inside] = _by_chunks(
                lambda some: self._chunk(motion.at(some), b, by_unknowns, own), time[inside]
            )
        return Prediction.of(time, state, covariance + self.path.added(time))

    def _turning(self, motion: Attitudes, b: FloatArray, by_unknowns: FloatArray, own: FloatArray) -> TurningPoint:
        """The body and a point of it, that changes by −by_unknowns δu beside an own deviation, at one time."""
        size, x = self.rotation.size, self.path.x
        state = {"epoch": float(motion.time[0]), "attitude": motion.attitude[0], "rate": motion.rate[0]}
        start = replace(self.rotation, torque=None, **state)

        def changed(turn: FloatArray, rate: FloatArray, inertia: FloatArray) -> Rotation:
            found = start.changed(turn, np.concatenate([rate, inertia]))
            return found if found.possible else replace(found, inertia=of_a_body(found.inertia))

        by_motion = np.concatenate([motion.turn[0], motion.rate_sensitivity[0], np.eye(5, size, 3)])
        by_u = np.concatenate([block_diag(by_motion, np.eye(len(x))), -by_unknowns])
        covariance = by_u @ self.covariance @ by_u.T
        covariance[-3:, -3:] += own
        return TurningPoint(start, changed, b, covariance, self.torque_density, self._lasting_torque())

    def _lasting_torque(self) -> LastingTorque | None:
        """The torque that goes on before and after the tracks, if they show one: by its mode without a wave."""
        torque = self.rotation.torque
        if torque is None or torque.orders[0] != 0:
            return None
        duration, own = torque.end - torque.begin, slice(RATE_AND_INERTIA, RATE_AND_INERTIA + 3)
        change = np.sqrt(duration) * torque.coefficients[0]
        return LastingTorque.of(change, duration * self.covariance[own, own], self.torque_density, duration)

    def _away(self, there: TurningPoint, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6), and their covariance (n, 6, 6), on one side of the tracks."""
        state, by_x, rest = self.path.sampled(time)
        mean, covariance = there.away(time, state, by_x)
        return mean, covariance + rest

    def _chunk(
        self, motion: Attitudes, b: FloatArray, by_unknowns: FloatArray, own: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n, 6) and covariance (n, 6, 6) of a point b (3,) that changes by −by_unknowns δu."""
        state, by_x, _ = self.path.sampled(motion.time)
        size = self.rotation.size
        arm, by_motion, by_b = carried(motion.attitude, motion.rate, b)
        total = -by_b @ by_unknowns
        total[:, :, :size] += by_motion @ np.concatenate([motion.turn, motion.rate_sensitivity], axis=1)
        total[:, :, size:] += by_x
        covariance = total @ self.covariance @ np.swapaxes(total, 1, 2) + by_b @ own @ np.swapaxes(by_b, 1, 2)
        of_turn = motion.turn @ self.covariance[:size, :size] @ np.swapaxes(motion.turn, 1, 2)
        shift, arc = curved(motion.attitude, motion.rate, b, of_turn)
        return state + arm + shift, covariance + arc

    def _own_covariance(self) -> FloatArray:
        """The covariance (3 m, 3 m) of the points for known u."""
        if self.points_covariance.ndim == 2:
            return self.points_covariance
        return np.asarray(block_diag(*self.points_covariance))


def point_in_body(
    point: str | Sequence[float] | FloatArray,
    labels: tuple[str, ...],
    points: FloatArray,
    seen: BoolArray,
    attached: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """A point (3,) in B from the centre of mass, m, and its Jacobian (3, 3 m) by the features' points (m, 3).

    seen (m,): which features are; attached: those whose axes and centroid body coordinates refer to.

    Raises:
        InputError: no such feature, or no such point.
    """
    m = len(points)
    if isinstance(point, str):
        if point not in labels:
            raise InputError(f"point is {point!r}, expected a feature's label or three coordinates in m")
        index = labels.index(point)
        if not seen[index]:
            raise InputError(f"point is {point!r}, which is not seen, expected a feature of the result")
        return points[index], np.eye(3 * m)[3 * index : 3 * index + 3]
    coordinates = array_of("point", point)
    if coordinates.shape != (3,) or not (np.abs(coordinates) <= FARTHEST).all():
        raise InputError(f"point is {point!r}, expected a feature's label or three coordinates within {FARTHEST:g} m")
    own = points[attached]
    turned = -cross_matrices(coordinates[None])[0] @ attached_turn(own)
    by_own = np.tile(np.eye(3), len(own)) / len(own) + turned
    by_points = np.zeros((3, m, 3))
    by_points[:, attached] = by_own.reshape(3, -1, 3)
    return own.mean(axis=0) + coordinates, by_points.reshape(3, 3 * m)


def times_of(time: ArrayLike) -> FloatArray:
    """Times (n,) in s for a prediction.

    Raises:
        InputError: they are not finite numbers.
    """
    times = np.atleast_1d(array_of("times", time))
    if times.ndim != 1 or not len(times) or not (np.abs(times) <= LATEST).all():
        raise InputError(f"times: expected finite numbers within ±{LATEST:g} s")
    return times
