"""Models of the path of the centre of mass in C: a fixed point, a polynomial in time, or relative orbital motion.

Each has a few unknowns x. A path sampled at given times is a function of x with a Jacobian. Fixed points and
polynomials are linear in x. Relative motion is exact in its position (the difference of two Kepler orbits); its
Jacobian is the linearisation by Yamanaka and Ankersen about a chaser at the target.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from baryscope.estimator.dynamics.prior import Hyperparameter, Prior
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.options import HIGHEST_DEGREE
from baryscope.models.errors import InputError
from baryscope.models.lvlh import lvlh_attitude, lvlh_rate
from baryscope.models.orbit import Orbit
from baryscope.models.relative_orbit import relative_path, relative_transition

FloatArray = NDArray[np.float64]

ARC = 0.01  # rad of true anomaly between nodes: the spline's error is 5/384 ARC⁴ of the distance, 3 nm at 20 m
FIXED = "fixed"
SMOOTH_DEGREE = 20  # of a smooth path: enough for half a turn of a circle to 1e-14 of its radius, for three to 1e-3
TRAJECTORIES = "fixed, polynomial, polynomial:N or relative-orbit"


class Path(Protocol):
    """A model of the path over a given time span."""

    @property
    def name(self) -> str:
        """The model's name, as on the command line."""
        ...

    @property
    def size(self) -> int:
        """The number of unknowns x."""
        ...

    def at(self, time: FloatArray) -> "SampledPath":
        """The path at times (n,) in s."""
        ...

    @property
    def prior(self) -> Prior:
        """The prior of x."""
        ...

    def rate_at(self, time: FloatArray) -> "SampledPath":
        """The velocity at times (n,) in s: a sampled path in m/s instead of m."""
        ...

    def gravity_gradient(self, time: FloatArray) -> FloatArray | None:
        """The gravity gradient (n, 3, 3) along the orbit in C, 1/s²; None if the model has none."""
        ...


@dataclass(frozen=True)
class SampledPath:
    """A path at n times: the function position, x (p,) → (n, 3) in m in C, and its jacobian (n, 3, p) by x."""

    jacobian: FloatArray
    position: Callable[[FloatArray], FloatArray]

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) of the positions, m², for the covariance (p, p) of x."""
        return np.asarray(self.jacobian @ of_x @ np.swapaxes(self.jacobian, 1, 2))

    def extended(self, columns: FloatArray) -> "SampledPath":
        """The path with further unknowns, of which it is a linear function with columns (n, 3, k)."""
        size = self.jacobian.shape[2]
        return SampledPath(
            np.concatenate([self.jacobian, columns], axis=2),
            lambda x: self.position(x[:size]) + columns @ x[size:],
        )

    def lengths(self, directions: FloatArray) -> FloatArray:
        """The rms displacement (k,) of the path, m, for changes (p, k) of x."""
        return np.asarray(np.sqrt(np.mean(np.sum((self.jacobian @ directions) ** 2, axis=1), axis=0)))


@dataclass(frozen=True)
class Polynomial:
    """Chebyshev polynomials of time scaled to [-1, 1] over begin … end: x is (degree + 1, 3), flat, in m."""

    degree: int
    begin: float
    end: float

    @property
    def name(self) -> str:
        """The model's name, as on the command line."""
        return f"polynomial:{self.degree}" if self.degree else FIXED

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return 3 * (self.degree + 1)

    @property
    def prior(self) -> Prior:
        """No prior."""
        return Prior.none(self.size)

    def gravity_gradient(self, time: FloatArray) -> None:
        """None: a polynomial knows no forces."""

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
        """The sampled path for the values (n, degree + 1) of the Chebyshev polynomials or of their derivatives."""
        jacobian = np.einsum("nd,ij->nidj", terms, np.eye(3)).reshape(len(terms), 3, self.size)
        return SampledPath(jacobian, lambda x: np.asarray(terms @ x.reshape(-1, 3)))


@dataclass(frozen=True)
class Smooth(Polynomial):
    """A smooth path: Chebyshev polynomials up to a high degree whose coefficients decrease geometrically.

    Those of a function that is analytic around the time span do (Trefethen, Approximation Theory and Approximation
    Practice, theorem 8.1). The prior variance of coefficient j ≥ 1 is that of the first times decay^(j − 1); both
    are hyperparameters. It takes the place of the choice of a degree, with its uncertainty.
    """

    @property
    def name(self) -> str:
        """The model's name, as on the command line."""
        return "polynomial"

    @property
    def prior(self) -> Prior:
        """That of the coefficients; the constant has none."""
        order = np.repeat(np.arange(self.degree), 3)
        slopes = np.column_stack([np.ones(len(order)), order.astype(np.float64)])
        parameters = (Hyperparameter("first coefficient"), Hyperparameter("decay", np.log(1e-8), 0.0))
        return Prior.none(3).joined(Prior(np.zeros(len(order)), slopes, parameters))


@dataclass(frozen=True)
class RelativeOrbit:
    """Free relative motion on a known orbit: x is the chaser's (ρ, ρ̇/n) in LVLH at the epoch in s, (6,), all in m.

    n is the orbit's mean motion; the CoM's position in C is −R_I_L ρ.
    """

    orbit: Orbit
    epoch: float

    name = "relative-orbit"
    size = 6

    @property
    def prior(self) -> Prior:
        """No prior."""
        return Prior.none(self.size)

    def gravity_gradient(self, time: FloatArray) -> FloatArray:
        """The gravity gradient (n, 3, 3) at the target in C, 1/s²: μ/r³ (3 u uᵀ − 1), u the radial direction."""
        radial = lvlh_attitude(self.orbit, time)[:, :, 0]
        # r² θ̇ is the angular momentum √(μ p).
        mu, semi_latus = (
            self.orbit.gravitational_parameter,
            self.orbit.semi_major_axis * (1 - self.orbit.eccentricity**2),
        )
        cubed = (np.sqrt(mu * semi_latus) / lvlh_rate(self.orbit, time)) ** 1.5
        return np.asarray((3 * radial[:, :, None] * radial[:, None] - np.eye(3)) * (mu / cubed)[:, None, None])

    @property
    def scale(self) -> FloatArray:
        """The factors (6,) from x to (ρ, ρ̇) in m and m/s."""
        return np.repeat([1.0, self.orbit.mean_motion], 3)

    def at(self, time: FloatArray) -> SampledPath:
        """The path at times (n,) in s; many times are interpolated by a cubic spline between nodes ARC apart."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        return self._sampled(time, nodes, lambda state: -(R_I_L @ state[:, :3]))

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The CoM's velocity in C, −R_I_L (ρ̇ + θ̇ e_z × ρ), at times (n,) in s, interpolated as in `at`."""
        nodes = self._nodes(time)
        R_I_L = lvlh_attitude(self.orbit, nodes)
        turn = lvlh_rate(self.orbit, nodes)[:, None, None] * cross_matrices(np.eye(3)[2:])
        return self._sampled(time, nodes, lambda state: -(R_I_L @ (state[:, 3:] + turn @ state[:, :3])))

    def _sampled(self, time: FloatArray, nodes: FloatArray, seen: Callable[[FloatArray], FloatArray]) -> SampledPath:
        """What `seen` makes of columns (k, 6, p) of the state (ρ, ρ̇) at k nodes, interpolated to the times (n,)."""
        jacobian = seen(relative_transition(self.orbit, nodes, self.epoch)) * self.scale

        def position(x: FloatArray) -> FloatArray:
            state = relative_path(self.orbit, self.scale * x, nodes, self.epoch)
            return _interpolated(nodes, seen(state[:, :, None])[:, :, 0], time)

        return SampledPath(_interpolated(nodes, jacobian, time), position)

    def _nodes(self, time: FloatArray) -> FloatArray:
        """Evenly spaced times that span the given ones, or the given ones themselves if they are few."""
        begin, end = float(time.min()), float(time.max())
        count = int(np.ceil((end - begin) * self.orbit.periapsis_rate / ARC)) + 1
        return time if len(time) < 4 * count or count < 4 else np.linspace(begin, end, count)


def _interpolated(nodes: FloatArray, values: FloatArray, time: FloatArray) -> FloatArray:
    return values if nodes is time else np.asarray(CubicSpline(nodes, values)(time))


@dataclass(frozen=True)
class Trajectory:
    """The chosen model of the path: its kind, and the degree of a polynomial, None if the data choose it."""

    kind: str
    degree: int | None = None

    def path(self, orbit: Orbit | None, begin: float, end: float) -> Path:
        """The path over begin … end in s; a polynomial without a given degree is a smooth path."""
        if self.kind == "relative-orbit" and orbit is not None:
            return RelativeOrbit(orbit, (begin + end) / 2)
        return Smooth(SMOOTH_DEGREE, begin, end) if self.degree is None else Polynomial(self.degree, begin, end)


def trajectory_of(text: str | None, orbit: Orbit | None) -> Trajectory:
    """The trajectory named `fixed`, `polynomial`, `polynomial:N` or `relative-orbit`.

    None means `relative-orbit` if there is an orbit, else `polynomial`.

    Raises:
        InputError: an unknown name, a degree out of range, or relative motion without an orbit.
    """
    if text is None:
        return Trajectory("polynomial" if orbit is None else "relative-orbit")
    if text == "relative-orbit" and orbit is None:
        raise InputError("trajectory is relative-orbit, which needs the target's orbit; expected an orbit")
    if text == FIXED:
        return Trajectory("polynomial", 0)
    kind, _, number = text.partition(":")
    if text in ("polynomial", "relative-orbit"):
        return Trajectory(kind)
    if kind != "polynomial" or not number.isdecimal():
        raise InputError(f"trajectory is {text!r}, expected {TRAJECTORIES}")
    if len(number) > 9 or int(number) > HIGHEST_DEGREE:
        raise InputError(f"trajectory is {text!r}, expected a degree of 0 to {HIGHEST_DEGREE}")
    return Trajectory("polynomial", int(number))
