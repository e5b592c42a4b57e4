"""Paths that the centre of mass may take in C: a fixed point, a polynomial in time, or relative orbital motion.

Each has a few unknowns x. A path sampled at the times of some frames has a position for every x, and a Jacobian, which
for the first two is all there is to it. Relative motion is exact in its position (the difference of two Kepler
orbits); its Jacobian is Yamanaka's and Ankersen's, which is that of the motion with the chaser close by.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.options import HIGHEST_DEGREE
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_path, relative_transition

FloatArray = NDArray[np.float64]

ARC = 0.01  # rad of true anomaly between nodes: leaves 5/384 ARC⁴ of the distance, 3 nm at 20 m, to the spline
TRAJECTORIES = "fixed, polynomial, polynomial:N or relative-orbit"


class Path(Protocol):
    """A kind of path."""

    @property
    def name(self) -> str:
        """As on the command line."""
        ...

    @property
    def size(self) -> int:
        """The number of unknowns x."""
        ...

    def at(self, time: FloatArray) -> "SampledPath":
        """The path at times (n,) in s."""
        ...

    def rate_at(self, time: FloatArray) -> "SampledPath":
        """The path's rate of change at times (n,) in s: velocities for positions, per s."""
        ...


@dataclass(frozen=True)
class SampledPath:
    """A path at n times: jacobian (n, 3, p) of the position in C by the unknowns, and position x (p,) → (n, 3) in m."""

    jacobian: FloatArray
    position: Callable[[FloatArray], FloatArray]

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """Of the positions, (n, 3, 3), from that of x, (p, p)."""
        return np.asarray(self.jacobian @ of_x @ np.swapaxes(self.jacobian, 1, 2))

    def lengths(self, directions: FloatArray) -> FloatArray:
        """How far the path moves, rms, along directions of x (p, k), (k,) in m."""
        return np.asarray(np.sqrt(np.mean(np.sum((self.jacobian @ directions) ** 2, axis=1), axis=0)))


@dataclass(frozen=True)
class Polynomial:
    """Chebyshev polynomials of time scaled to [-1, 1] over begin … end: x is (degree + 1, 3), flat, in m."""

    degree: int
    begin: float
    end: float

    @property
    def name(self) -> str:
        """As on the command line."""
        return f"polynomial:{self.degree}" if self.degree else "fixed"

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return 3 * (self.degree + 1)

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s."""
        return self._sampled(chebyshev.chebvander(self._scaled(time), self.degree))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The path's velocity at times (n,) in s."""
        derivatives = chebyshev.chebder(np.eye(self.degree + 1)) / self._half
        return self._sampled(chebyshev.chebval(self._scaled(time), derivatives).T)

    @property
    def _half(self) -> float:
        return max((self.end - self.begin) / 2, 1e-300)

    def _scaled(self, time: FloatArray) -> FloatArray:
        return np.asarray((time - (self.begin + self.end) / 2) / self._half)

    def _sampled(self, terms: NDArray[Any]) -> SampledPath:
        """From the polynomials' values (n, degree + 1)."""
        jacobian = np.einsum("nd,ij->nidj", terms, np.eye(3)).reshape(len(terms), 3, self.size)
        return SampledPath(jacobian, lambda x: np.asarray(terms @ x.reshape(-1, 3)))


@dataclass(frozen=True)
class RelativeOrbit:
    """Free relative motion on a known orbit: x is the chaser's (ρ, ρ̇/n) in LVLH at the epoch, all in m.

    n is the orbit's mean motion; the CoM is seen at −R_I_L ρ.
    """

    orbit: Orbit
    epoch: float

    name = "relative-orbit"
    size = 6

    @property
    def scale(self) -> FloatArray:
        """(ρ, ρ̇) is this times x, (6,)."""
        return np.repeat([1.0, self.orbit.mean_motion], 3)

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s; between nodes ARC apart, where there are more times, by a cubic spline."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        return self._sampled(time, nodes, np.concatenate([-R_I_L, np.zeros_like(R_I_L)], axis=2))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The CoM's velocity in C, −R_I_L (ρ̇ + θ̇ e_z × ρ), at times (n,) in s, likewise."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        turn = lvlh_rate(self.orbit, nodes)[:, None, None] * cross_matrices(np.eye(3)[2:])
        return self._sampled(time, nodes, -np.concatenate([R_I_L @ turn, R_I_L], axis=2))

    def _sampled(self, time: FloatArray, nodes: FloatArray, by_state: FloatArray) -> SampledPath:
        """What follows (ρ, ρ̇) by matrices (k, 3, 6) at the nodes."""
        transition = relative_transition(self.orbit, nodes, self.epoch)
        jacobian = (by_state @ transition) * self.scale

        def position(x: FloatArray) -> FloatArray:
            state = relative_path(self.orbit, self.scale * x, nodes, self.epoch)
            return _between(nodes, (by_state @ state[:, :, None])[:, :, 0], time)

        return SampledPath(_between(nodes, jacobian, time), position)

    def _nodes(self, time: FloatArray) -> FloatArray:
        """Evenly spaced times around the given ones, or these themselves where they are few."""
        begin, end = float(time.min()), float(time.max())
        count = int(np.ceil((end - begin) * self.orbit.periapsis_rate / ARC)) + 1
        return time if len(time) < 4 * count or count < 4 else np.linspace(begin, end, count)


def _between(nodes: FloatArray, values: FloatArray, time: FloatArray) -> FloatArray:
    return values if nodes is time else np.asarray(CubicSpline(nodes, values)(time))


@dataclass(frozen=True)
class Trajectory:
    """What is known of the path before it is estimated: its kind, and a polynomial's degree, None to be chosen."""

    kind: str
    degree: int | None = None

    def path(self, orbit: Orbit | None, begin: float, end: float, degree: int) -> Path:
        """The path over begin … end in s; `degree` is that of a polynomial whose degree is open."""
        if self.kind == "relative-orbit" and orbit is not None:
            return RelativeOrbit(orbit, (begin + end) / 2)
        return Polynomial(degree if self.degree is None else self.degree, begin, end)


def trajectory_of(text: str | None, orbit: Orbit | None) -> Trajectory:
    """Read `fixed`, `polynomial`, `polynomial:N` or `relative-orbit`; None is the last where there is an orbit.

    Raises:
        InputError: another text, a degree that is none, or relative motion without an orbit.
    """
    if text is None:
        return Trajectory("polynomial" if orbit is None else "relative-orbit")
    if text == "relative-orbit" and orbit is None:
        raise InputError("trajectory is relative-orbit, which needs the target's orbit; expected an orbit")
    if text == "fixed":
        return Trajectory("polynomial", 0)
    kind, _, number = text.partition(":")
    if text in ("polynomial", "relative-orbit"):
        return Trajectory(kind)
    if kind != "polynomial" or not number.isdecimal():
        raise InputError(f"trajectory is {text!r}, expected {TRAJECTORIES}")
    if int(number) > HIGHEST_DEGREE:
        raise InputError(f"trajectory is {text!r}, expected a degree of 0 to {HIGHEST_DEGREE}")
    return Trajectory("polynomial", int(number))
