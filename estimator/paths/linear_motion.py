"""Linear motion p̈ = G(t) p + a(t) along an orbit, or in free flight (G = 0), for many accelerations at once.

The motion is integrated from an epoch over short panels of time by collocation at Gauss's points, of order twelve in a
panel's length (Hairer, Nørsett, Wanner 1993, §II.7). The equation is linear, so the panels are solved all at once and
then chained. Between the ends of a panel the motion is the polynomial of the collocation.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Gradient = Callable[[FloatArray], FloatArray | None]  # times (k,) in s → G (k, 3, 3) in C, 1/s²; None: free flight
Acceleration = Callable[[FloatArray], FloatArray]  # times (k,) in s → c accelerations (k, 3, c) in C, m/s²
Integrated = TypeVar("Integrated")

POINTS = 6  # of Gauss in a panel
GRADIENT_TIMES = 513  # at which the greatest gravity gradient is looked for
BEYOND = 2  # reaches beyond begin … end, of which what was integrated is kept
ARC = 0.15  # rad that an orbit turns at most in a panel: errors of 1e-11 of the motion

_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(POINTS)
_NODES = (_ROOTS + 1) / 2
_LAGRANGE = np.linalg.inv(np.vander(_NODES, increasing=True))  # (powers, points): the Lagrange polynomials
_POWERS = np.arange(1, POINTS + 1)


def _first_integrals(s: FloatArray) -> FloatArray:
    """∫ of the Lagrange polynomials from 0 to s, (k, POINTS)."""
    return np.asarray((s[:, None] ** _POWERS / _POWERS) @ _LAGRANGE)


def _second_integrals(s: FloatArray) -> FloatArray:
    """The integrals of `_first_integrals` from 0 to s, (k, POINTS)."""
    return np.asarray((s[:, None] ** (_POWERS + 1) / (_POWERS * (_POWERS + 1))) @ _LAGRANGE)


_AT_NODES, _AT_END = _second_integrals(_NODES), _second_integrals(np.ones(1))[0]


def highest_frequency(gradient: Gradient, begin: float, end: float) -> float:
    """The root of the greatest gravity gradient over begin … end in s, rad/s; 0 in free flight.

    An orbit nowhere turns faster.
    """
    found = gradient(np.linspace(begin, end, GRADIENT_TIMES))
    return 0.0 if found is None else float(np.sqrt(np.linalg.norm(found, axis=(1, 2)).max()))


@dataclass(eq=False)
class Integrations(Generic[Integrated]):
    """What is integrated once for all times within begin … end in s, and for those that lead beyond, once for as far.

    A path's position and velocity are asked for at the same times, and a force that acts on it asks for the path at
    the panels' points again.
    """

    integrate: Callable[[FloatArray], Integrated]
    begin: float
    end: float
    _kept: dict[tuple[float, float], Integrated] = field(default_factory=dict, init=False, repr=False)

    def over(self, time: FloatArray) -> Integrated:
        """That over the times (n,)."""
        reach = float(time.min(initial=self.begin)), float(time.max(initial=self.end))
        if reach not in self._kept:
            for other in [one for one in self._kept if one != (self.begin, self.end)][: 1 - BEYOND]:
                del self._kept[other]
            self._kept[reach] = self.integrate(np.array(reach))
        return self._kept[reach]


@dataclass(frozen=True, eq=False)
class Panels:
    """Panels of time: edges (k + 1,) in s, ascending, among which edges[origin] is the epoch."""

    edges: FloatArray
    origin: int

    @classmethod
    def over(cls, time: FloatArray, epoch: float, longest: float, breaks: FloatArray | None = None) -> "Panels":
        """Panels of at most `longest` s that span times (n,) and the epoch, with edges at the breaks (m,), all in s."""
        begin, end = min(float(time.min(initial=epoch)), epoch), max(float(time.max(initial=epoch)), epoch)
        end = end if end > begin else begin + min(longest, 1.0)
        inner = np.zeros(0) if breaks is None else breaks[(breaks > begin) & (breaks < end)]
        inner = inner[np.abs(inner - epoch) > 1e-9 * (end - begin)]
        marks = np.unique(np.concatenate([[begin, epoch, end], inner]))
        counts = np.ceil(np.diff(marks) / longest).astype(np.intp).clip(1)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        edges = np.append(np.repeat(marks[:-1], counts) + within * np.repeat(np.diff(marks) / counts, counts), end)
        return cls(edges, int(np.searchsorted(edges, epoch)))

    @property
    def length(self) -> FloatArray:
        """The lengths (k,) in s."""
        return np.diff(self.edges)

    @property
    def points(self) -> FloatArray:
        """The times (k POINTS,) of the Gauss points, in s."""
        return np.asarray(self.edges[:-1, None] + self.length[:, None] * _NODES).ravel()


@dataclass(frozen=True, eq=False)
class Motion:
    """c motions over panels: state (k, 6, c) at the panels' begins in m and m/s, total (k, POINTS, 3, c) in m/s².

    `total` is the acceleration at the Gauss points, that of the gradient included.
    """

    panels: Panels
    state: FloatArray
    total: FloatArray

    @property
    def at_points(self) -> FloatArray:
        """The positions (k, POINTS, 3, c) at the Gauss points."""
        h = self.panels.length[:, None, None, None]
        straight = self.state[:, None, :3] + h * _NODES[:, None, None] * self.state[:, None, 3:]
        return np.asarray(straight + h * h * np.einsum("ij,kjac->kiac", _AT_NODES, self.total, optimize=True))

    def position(self, time: FloatArray) -> FloatArray:
        """The positions (n, 3, c) in m at times (n,) in s."""
        return self._evaluated(time, lambda h, s: [np.ones_like(s), h * s, h * h * _second_integrals(s).T])

    def velocity(self, time: FloatArray) -> FloatArray:
        """The velocities (n, 3, c) in m/s at times (n,) in s."""
        return self._evaluated(time, lambda h, s: [np.zeros_like(s), np.ones_like(s), h * _first_integrals(s).T])

    def __add__(self, other: "Motion") -> "Motion":
        return Motion(self.panels, self.state + other.state, self.total + other.total)

    def __matmul__(self, combinations: FloatArray) -> "Motion":
        """The linear combinations (c, d) of the motions."""
        return Motion(self.panels, self.state @ combinations, self.total @ combinations)

    def _evaluated(self, time: FloatArray, terms: Callable[[FloatArray, FloatArray], list[FloatArray]]) -> FloatArray:
        """The combinations (n, 3, c) of state and accelerations of the panel of each time.

        terms: what multiplies position, velocity and accelerations, (n,), (n,) and (POINTS, n), for the panels' lengths
        h (n,) in s and fractions s (n,) of them.
        """
        edges, columns = self.panels.edges, self.state.shape[2]
        order = np.argsort(time, kind="stable")
        panel = np.clip(np.searchsorted(edges, time[order], "right") - 1, 0, len(edges) - 2)
        h = self.panels.length[panel]
        factors = np.vstack(terms(h, (time[order] - edges[panel]) / h)).T
        found = np.empty((len(time), 3 * columns))
        bounds = np.flatnonzero(np.diff(panel, prepend=-1, append=len(edges)))
        for begin, end in pairwise(bounds):
            here = panel[begin]
            values = [self.state[here].reshape(2, -1), self.total[here].reshape(POINTS, -1)]
            found[order[begin:end]] = factors[begin:end] @ np.concatenate(values)
        return found.reshape(len(time), 3, columns)


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """The equation p̈ = G(t) p + a(t) over panels, from their epoch; gradient (k POINTS, 3, 3), or None in free flight.

    `gradient` are the values of G at the panels' Gauss points, 1/s².
    """

    panels: Panels
    gradient: FloatArray | None

    @classmethod
    def over(cls, panels: Panels, gradient: Gradient) -> "LinearMotion":
        """The equation with the gradient given as a function."""
        return cls(panels, gradient(panels.points))

    @cached_property
    def free(self) -> Motion:
        """Six motions without acceleration, from unit position (1 m) and unit velocity (1 m/s) at the epoch."""
        k = len(self.panels.length)
        return self._chained(np.zeros((k, POINTS, 3, 6)), np.eye(6))

    def forced(self, acceleration: FloatArray) -> Motion:
        """The motions by accelerations (k POINTS, 3, c) at the Gauss points, m/s², from rest at zero at the epoch."""
        k, columns = len(self.panels.length), acceleration.shape[-1]
        return self._chained(acceleration.reshape(k, POINTS, 3, columns), np.zeros((6, columns)))

    def transition(self, time: FloatArray) -> FloatArray:
        """Φ (n, 6, 6) from position and velocity in C at the epoch to those at times (n,) in s, SI."""
        return np.concatenate([self.free.position(time), self.free.velocity(time)], axis=1)

    @cached_property
    def _solution(self) -> tuple[FloatArray, FloatArray | None]:
        """What the state at a panel's begin makes of the acceleration at its points (k, POINTS, 3, 6), and what the
        accelerations given there do, (k, 3 POINTS, 3 POINTS), None for the unit matrix."""
        k, h = len(self.panels.length), self.panels.length
        if self.gradient is None:
            return np.zeros((k, POINTS, 3, 6)), None
        G = self.gradient.reshape(k, POINTS, 3, 3)
        coupling = np.einsum("k,ij,kiab->kiajb", h * h, _AT_NODES, G, optimize=True)
        solve = np.linalg.inv(np.eye(3 * POINTS) - coupling.reshape(k, 3 * POINTS, 3 * POINTS))
        by_velocity = h[:, None, None, None] * _NODES[:, None, None] * G
        pull = np.concatenate([G, by_velocity], axis=3).reshape(k, 3 * POINTS, 6)
        return (solve @ pull).reshape(k, POINTS, 3, 6), solve

    @cached_property
    def _steps(self) -> FloatArray:
        """The transitions (k, 6, 6) over each panel."""
        h = self.panels.length[:, None, None]
        by_state = self._solution[0]
        steps = np.zeros((len(h), 6, 6)) + np.eye(6)
        steps[:, :3, 3:] += h * np.eye(3)
        steps[:, :3] += h * h * np.einsum("j,kjac->kac", _AT_END, by_state)
        steps[:, 3:] += h * np.einsum("j,kjac->kac", _WEIGHTS / 2, by_state)
        return steps

    def _chained(self, acceleration: FloatArray, start: FloatArray) -> Motion:
        """The motions with a state (6, c) at the epoch."""
        k, h = len(self.panels.length), self.panels.length[:, None, None]
        by_state, solve = self._solution
        own = acceleration if solve is None else (solve @ acceleration.reshape(k, 3 * POINTS, -1))
        own = own.reshape(acceleration.shape)
        gain = np.concatenate(
            [
                h * h * np.einsum("j,kjac->kac", _AT_END, own),
                h * np.einsum("j,kjac->kac", _WEIGHTS / 2, own),
            ],
            axis=1,
        )
        origin, steps = self.panels.origin, self._steps
        state = np.empty((k + 1, 6, start.shape[1]))
        state[origin] = start
        for panel in range(origin, k):
            np.matmul(steps[panel], state[panel], out=state[panel + 1])
            state[panel + 1] += gain[panel]
        back = np.linalg.inv(steps[:origin])
        for panel in range(origin - 1, -1, -1):
            np.matmul(back[panel], state[panel + 1] - gain[panel], out=state[panel])
        return Motion(self.panels, state[:-1], own + np.einsum("kjas,ksc->kjac", by_state, state[:-1], optimize=True))


def forced(
    time: FloatArray,
    epoch: float,
    gradient: Gradient,
    acceleration: Acceleration,
    longest: float,
    breaks: FloatArray | None = None,
) -> Motion:
    """What accelerations add to the path of the centre of mass, from nothing at the epoch.

    Args:
        time: (n,), s, that the motion is to span.
        epoch: s.
        gradient: of gravity along the orbit, as `Path.gravity_gradient` gives it.
        acceleration: of the centre of mass as seen from the chaser: of the target, less that of the chaser.
        longest: s, in which an orbit turns by at most ARC, and an oscillation of the accelerations by a radian.
        breaks: (m,), s, at which they jump.
    """
    equation = LinearMotion.over(Panels.over(time, epoch, longest, breaks), gradient)
    return equation.forced(acceleration(equation.panels.points))
