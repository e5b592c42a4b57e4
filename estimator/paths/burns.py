"""Unknown burns of the chaser: a path with further unknowns for what each changes, and for when it begins and ends.

A burn is a constant acceleration in LVLH, or in C without an orbit, over an unknown time. The path is linear in the
change of velocity Δv = ∫ a dt, and nearly so in small changes of the burn's times. With G(t, s) the displacement at t
by a unit velocity at s, W = −∫ G(t, s) R(s) ds over begin … end and τ = end − begin, the path moves by W Δv/τ, and its
derivatives by the times are −G(t, end) R Δv/τ − W Δv/τ² and the same with opposite signs at the begin.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.extended_path import ExtendedPath, parts_of
from baryscope.estimator.paths.forces import longest_on
from baryscope.estimator.paths.linear_motion import LinearMotion, Motion, Panels
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Prior
from baryscope.estimator.paths.relative_motion import bend
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.models.ephemeris.trajectory import lvlh_axes, target_states
from baryscope.models.orbit import Orbit

FloatArray = NDArray[np.float64]

UNKNOWNS = 5  # of a burn: the change of velocity, its middle and its duration
SHORTEST = 1e-3  # s, of a burn's duration
SHORTENED = 4.0  # times, at once
SETTLED = 0.1  # change of a time, over its deviation
HELD = 0.1  # of an untold duration's deviation: that of a prior which holds it


@dataclass(frozen=True, eq=False)
class Burn:
    """A burn as a path is linearised about it, with its prior.

    begin, end in s; change (3,) of the chaser's velocity in LVLH (in C without an orbit), m/s; deviation of the prior
    of each of its components about zero, m/s; slack: standard deviations of the prior of its middle and of its
    duration about those of begin … end, s; untold: the standard deviation of a duration that the tracks hardly tell,
    s, at whose mean it is held, see `untold_durations`; 0: it is told.
    """

    begin: float
    end: float
    change: FloatArray
    deviation: float
    slack: tuple[float, float]
    untold: float = 0.0

    @property
    def duration(self) -> float:
        """The time from begin to end, s."""
        return self.end - self.begin

    @property
    def held(self) -> float:
        """The standard deviation of the prior of its duration where it may be held, s."""
        return HELD * self.untold if self.untold > 0 else self.slack[1]

    @property
    def speed(self) -> float:
        """The magnitude of the change, m/s; not zero."""
        return max(float(np.linalg.norm(self.change)), 1e-12)


@dataclass(frozen=True, eq=False)
class FoundBurn:
    """An estimated burn of the chaser: begin and end in s with standard deviations; change (3,) of its velocity, m/s,
    in LVLH (in C without an orbit), and its covariance (3, 3).
    """

    begin: float
    begin_deviation: float
    end: float
    end_deviation: float
    change: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class BurnedPath(ExtendedPath):
    """A path with unknown burns of the chaser over first … last in s: the unknowns of `base`, then five of each burn.

    Those are the change of velocity times the span, and the changes of middle and duration times the speed, all in m.
    about: the unknowns of the base about which the response to the burns has what gravity adds beyond its gradient, of
    the order of the distance squared over the orbit's radius; None: without it.
    """

    orbit: Orbit | None
    burns: tuple[Burn, ...]
    first: float
    last: float
    about: FloatArray | None = None

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.base.size + UNKNOWNS * len(self.burns)

    @cached_property
    def prior(self) -> Prior:
        """The prior of the base, and those of the burns."""
        return self.base.prior.joined(Prior.known(self.variances))

    @property
    def variances(self) -> FloatArray:
        """The variances (5 k,) of the prior of the burns' unknowns, m²."""
        deviations = np.array([[burn.deviation] * 3 + [burn.slack[0], burn.held] for burn in self.burns])
        return np.asarray((self._units * deviations).ravel() ** 2)

    @property
    def values(self) -> FloatArray:
        """The unknowns of the burns (5 k,) about which the path is linear, m."""
        values = np.array([[*burn.change, 0.0, 0.0] for burn in self.burns])
        return np.asarray(self._units * values).ravel()

    @property
    def frequency(self) -> float:
        """Infinite: accelerations jump; see `Path`."""
        return np.inf

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        found, bend = self.base.at(time).extended(self.columns(time)), self.bend(time)
        return found if bend is None else found.moved(bend)

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s."""
        found, bend = self.base.rate_at(time).extended(self.columns(time, rate=True)), self.bend(time, rate=True)
        return found if bend is None else found.moved(bend)

    def columns(self, time: FloatArray, *, rate: bool = False) -> FloatArray:
        """The derivatives (n, 3, 5 k) of position, or of velocity, by the unknowns of the burns."""
        edges, equation = self._edges, self._equation(time)
        seen = Motion.velocity if rate else Motion.position
        now, free = seen(equation.free, time), np.linalg.inv(equation.transition(edges))
        axes = burn_axes(self.orbit, edges)
        pushed = seen(equation.forced(self._pushes(equation.panels.points)), time).reshape(len(time), 3, -1, 3)
        found = np.empty((len(time), 3, len(self.burns), UNKNOWNS))
        for index, burn in enumerate(self.burns):
            kicks = [
                np.where((time >= at)[:, None], now @ (free[row][:, 3:] @ -(axes[row] @ burn.change)), 0.0)
                for row, at in ((2 * index, burn.begin), (2 * index + 1, burn.end))
            ]
            by_begin, by_end = -kicks[0] / burn.duration, kicks[1] / burn.duration
            by_length = pushed[:, :, index] @ burn.change / burn.duration
            found[:, :, index, :3] = pushed[:, :, index]
            found[:, :, index, 3] = by_begin + by_end
            found[:, :, index, 4] = (by_end - by_begin) / 2 - by_length
        return (found / self._units).reshape(len(time), 3, -1)

    def bend(self, time: FloatArray, *, rate: bool = False) -> FloatArray | None:
        """What gravity beyond its gradient adds to the response to the burns, (n, 3) in m or m/s; None if left out."""
        if self.about is None or self.orbit is None:
            return None
        equation = self._equation(time)
        points = equation.panels.points
        before = self.base.at(points).position(self.about)
        motion = bend(equation, self.orbit, before, before + self.columns(points) @ self.values)
        return (motion.velocity(time) if rate else motion.position(time))[:, :, 0]

    def settled(self, x: FloatArray, of_x: FloatArray) -> tuple[tuple[Burn, ...], bool]:
        """The burns at unknowns (5 k,) of theirs with a covariance (5 k, 5 k), and whether their times are as before.

        A time moves by no more than half the duration. The prior's deviation becomes that of the change.
        """
        burns, still = [], True
        for old, one in zip(self.burns, self.found(x, of_x, 0), strict=True):
            most = max(old.duration, min(old.slack)) / 2
            begin = max(old.begin + float(np.clip(one.begin - old.begin, -most, most)), self.first)
            end = min(old.end + float(np.clip(one.end - old.end, -most, most)), self.last)
            if end - begin < SHORTEST:  # much shorter than now, which is as far as the path may be linear in it
                middle, shorter = (begin + end) / 2, max(old.duration / SHORTENED, SHORTEST) / 2
                begin, end = max(middle - shorter, self.first), min(middle + shorter, self.last)
            still = still and abs(begin - old.begin) <= SETTLED * one.begin_deviation
            still = still and abs(end - old.end) <= SETTLED * one.end_deviation
            deviation = float(np.sqrt((one.change @ one.change + np.trace(one.covariance)) / 3))
            burns.append(Burn(begin, end, one.change, deviation, old.slack))
        return tuple(burns), still

    def found(self, x: FloatArray, of_x: FloatArray, first: int) -> tuple[FoundBurn, ...]:
        """The burns at unknowns x (p,) of a covariance (p, p), among which those of the burns begin at `first`."""
        own = slice(first, first + UNKNOWNS * len(self.burns))
        factor = 1 / self._units.ravel()
        values = (factor * x[own]).reshape(-1, UNKNOWNS)
        covariance = of_x[own, own] * np.outer(factor, factor)
        found = []
        for index, burn in enumerate(self.burns):
            part = covariance[UNKNOWNS * index : UNKNOWNS * (index + 1), UNKNOWNS * index : UNKNOWNS * (index + 1)]
            part[4, 4] = max(part[4, 4], burn.untold**2)
            by = np.array([[1.0, -0.5], [1.0, 0.5]])
            begin, end = (by @ values[index, 3:]).tolist()
            first_deviation, last_deviation = np.sqrt(np.maximum(np.diag(by @ part[3:, 3:] @ by.T), 0.0)).tolist()
            middle, length = (burn.begin + burn.end + begin + end) / 2, max(burn.duration + end - begin, 0.0)
            begin, end = middle - length / 2, middle + length / 2
            found.append(FoundBurn(begin, first_deviation, end, last_deviation, values[index, :3], part[:3, :3]))
        return tuple(found)

    def untold(self, of_x: FloatArray, first: int) -> FloatArray:
        """See `untold_durations`; `first` as in `found`."""
        columns = np.zeros((len(of_x), len(self.burns)))
        for index, burn in enumerate(self.burns):
            at = first + UNKNOWNS * index + UNKNOWNS - 1
            missing = (burn.untold * self._units[index, -1]) ** 2 - of_x[at, at]
            columns[at, index] = np.sqrt(max(missing, 0.0)) / of_x[at, at]
        return columns[:, columns.any(axis=0)]

    @cached_property
    def _units(self) -> FloatArray:
        """The factors (k, 5) from changes of velocity in m/s and of times in s to unknowns in m."""
        span = max(self.last - self.first, SHORTEST)
        return np.array([[span] * 3 + [burn.speed] * 2 for burn in self.burns]).reshape(-1, UNKNOWNS)

    @property
    def _edges(self) -> FloatArray:
        """Begin and end of each burn, (2 k,) in s."""
        return np.array([[burn.begin, burn.end] for burn in self.burns]).ravel()

    def _equation(self, time: FloatArray) -> LinearMotion:
        """The motion over times (n,), with panels that end where a burn begins or ends."""
        longest = longest_on(self.orbit, self.first, self.last)
        return LinearMotion.over(Panels.over(time, self.first, longest, self._edges), self.base.gravity_gradient)

    def _pushes(self, time: FloatArray) -> FloatArray:
        """The accelerations (k, 3, 3 b) of the centre of mass in C, 1/s, by a unit change of velocity of each burn."""
        axes = burn_axes(self.orbit, time)
        on = [((time >= burn.begin) & (time < burn.end)) / burn.duration for burn in self.burns]
        return np.concatenate([-one[:, None, None] * axes for one in on], axis=2)


def burn_axes(orbit: Orbit | None, time: FloatArray) -> FloatArray:
    """The rotations (k, 3, 3) from the axes of burns to C at times (k,) in s."""
    return np.tile(np.eye(3), (len(time), 1, 1)) if orbit is None else lvlh_axes(target_states(orbit, time))


def burned_in(path: Path) -> BurnedPath | None:
    """The part of a path that has unknown burns, if one has."""
    return next((one for one in parts_of(path) if isinstance(one, BurnedPath)), None)


def burns_of(path: Path, x: FloatArray, of_x: FloatArray) -> tuple[FoundBurn, ...]:
    """The burns on a path, from its x (p,) and the covariance (p, p)."""
    burned = burned_in(path)
    return () if burned is None else burned.found(x, of_x, burned.base.size)


def untold_durations(path: Path, of_x: FloatArray) -> FloatArray:
    """The gradients G (p, k) of half the cost that burns of untold durations exert on x, in units of its information.

    of_x (p, p): a covariance of x, in which these durations are held at their means. It grows by the square of
    of_x @ G, so that of the durations it is then as wide as they are untold, and with them what depends on them. The
    path bends by a duration, the more so the shorter it is: linearised about the mean it would be told too well.
    """
    burned = burned_in(path)
    return np.zeros((len(of_x), 0)) if burned is None else burned.untold(of_x, burned.base.size)
