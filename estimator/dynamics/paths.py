"""Models of the path of the centre of mass in C: what they have in common, and fixed points and polynomials in time.

Each has a few unknowns x. A path sampled at given times is a function of x with a Jacobian. Fixed points and
polynomials are linear in x. Relative motion stands in `relative_motion`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.dynamics.prior import Hyperparameter, Prior, Trend

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
Frames = slice | IntArray

FIXED = "fixed"
FIRST, FREQUENCY, STEEP = "first coefficient", "frequency", "steepness"  # the names of hyperparameters
LOWEST_FREQUENCY = 1e-2  # of a smooth path's coefficients, rad in half the time span
STEEPNESS = (0.0, 1.0)  # of their decrease; 1 is that of waves, 0 that of ellipses
POWER = 5 / 3  # of it: for branch points with a power of 2/3, as Kepler's motion has in complex time
SHARPNESS = 3.0  # of the transition from a law with a frequency to one with a rate
LONGEST = 1e6  # m, of a smooth path's coefficients: a bound on their law, which nothing comes near
SCATTER = 1.0  # of the logarithm of the variances from a coefficient on that the tracks do not tell: the law is a trend


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
    def frequency(self) -> float:
        """The highest angular frequency of the Jacobian and of the path, rad/s; infinite if they are not smooth."""
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
    """A path at n times: the function position, x (p,) → (n, 3) in m in C, and its jacobian (n, 3, p) by x.

    If it is what a camera with errors sees (`seen`): seen_of, the path itself, and turn (n, 3, p), the derivative by x
    of the attitudes that it sees, as rotation vectors in C.
    """

    jacobian: FloatArray
    position: Callable[[FloatArray], FloatArray]
    seen_of: "SampledPath | None" = None
    turn: FloatArray | None = None

    @property
    def itself(self) -> "SampledPath":
        """The path itself, whatever a camera sees."""
        return self if self.seen_of is None else self.seen_of

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return int(self.jacobian.shape[2])

    @property
    def frames(self) -> int:
        """The number of times n."""
        return len(self.jacobian)

    def covariance(self, of_x: FloatArray) -> FloatArray:
        """The covariance (n, 3, 3) of the positions, m², for the covariance (p, p) of x."""
        return np.asarray(self.times(of_x) @ np.swapaxes(self.jacobian, 1, 2))

    def times(self, columns: FloatArray) -> FloatArray:
        """The products (n, 3, k) of the Jacobian with columns (p, k)."""
        # One multiplication: one for each frame would take several times as long.
        return np.asarray((self.jacobian.reshape(-1, self.size) @ columns).reshape(self.frames, 3, -1))

    def gram(self, frames: Frames, weights: FloatArray) -> FloatArray:
        """Σ Jᵀ W J (p, p) over k ascending frames, for symmetric weights (k, 3, 3)."""
        own = self.jacobian[frames]
        return np.asarray(own.reshape(-1, self.size).T @ (weights @ own).reshape(-1, self.size))

    def gram_and_diagonal(
        self, frames: Frames, weights: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """That, and the diagonal (p,) of the same for other weights (k, 3, 3)."""
        own = self.jacobian[frames]
        return self.gram(frames, weights), np.asarray(np.einsum("kip,kip->p", own, others @ own))

    def mean_square(self) -> FloatArray:
        """The mean (p, p) of Jᵀ J over the frames."""
        return self.gram(slice(0, self.frames), np.broadcast_to(np.eye(3), (self.frames, 3, 3))) / self.frames

    def moment(self, frames: Frames, values: FloatArray) -> FloatArray:
        """Σ Jᵀ v (..., p, c) over k ascending frames, for values (..., k, 3, c)."""
        *lead, _, _, columns = values.shape
        return product(self.jacobian[frames].reshape(-1, self.size), values.reshape(*lead, -1, columns))

    @property
    def offset(self) -> FloatArray:
        """The position (n, 3) at x = 0, where known accelerations alone bring it, m."""
        return self.position(np.zeros(self.size))

    def extended(self, columns: FloatArray) -> "SampledPath":
        """The path with further unknowns, of which it is a linear function with columns (n, 3, k)."""
        size = self.size
        return SampledPath(
            np.concatenate([self.jacobian, columns], axis=2),
            lambda x: self.position(x[:size]) + columns @ x[size:],
            None if self.seen_of is None else self.seen_of.extended(columns),
            None if self.turn is None else np.concatenate([self.turn, np.zeros_like(columns)], axis=2),
        )

    def frames_at(self, index: IntArray) -> "SampledPath":
        """The path at some of its times, by their ascending indices (k,)."""
        seen_of = None if self.seen_of is None else self.seen_of.frames_at(index)
        turn = None if self.turn is None else self.turn[index]
        return SampledPath(self.jacobian[index], lambda x: self.position(x)[index], seen_of, turn)

    def moved(self, by: FloatArray) -> "SampledPath":
        """The path moved by (n, 3) in m."""
        seen_of = None if self.seen_of is None else self.seen_of.moved(by)
        return SampledPath(self.jacobian, lambda x: self.position(x) + by, seen_of, self.turn)

    def lengths(self, directions: FloatArray) -> FloatArray:
        """The rms displacement (k,) of the path, m, for changes (p, k) of x."""
        return np.asarray(np.sqrt(np.mean(np.sum(self.times(directions) ** 2, axis=1), axis=0)))


def product(jacobian: FloatArray, values: FloatArray) -> FloatArray:
    """Jᵀ v (..., p, c) for J (k, p) and v (..., k, c), in one multiplication."""
    rows = np.moveaxis(values, -2, 0)
    found = jacobian.T @ rows.reshape(len(jacobian), -1)
    return np.asarray(np.moveaxis(found.reshape(-1, *rows.shape[1:]), 0, -2))


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

    @property
    def frequency(self) -> float:
        """That of the highest polynomial T_d, in the middle or at the ends, where T_d(1 − y) ≈ cos √(2 d² y).

        A wave of d²/6 has there a term of seventh order as great, and greater ones of higher order.
        """
        return max(self.degree, self.degree**2 / 6) / self._half

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
    """A smooth path: Chebyshev polynomials up to a high degree whose coefficients decrease as those of orbits do.

    A wave of x rad in half the time span has coefficients ±2 Jⱼ(x): as large up to j = x, and beyond, less than any
    power. Those of an ellipse decrease as ρ^−j j^(−5/3), with the branch points of Kepler's motion on the Bernstein
    ellipse of ρ. The law of the standard deviations has both as its ends (`_decrease`). The variance of the first
    coefficient, frequency or rate, and the steepness are hyperparameters. They take the place of the choice of a
    degree, with its uncertainty. Each coefficient that the tracks do not tell may break the law, for all that follow.
    """

    @property
    def name(self) -> str:
        """The model's name, as on the command line."""
        return "polynomial"

    @property
    def prior(self) -> Prior:
        """That of the coefficients; the constant has none."""
        order = np.repeat(np.arange(1.0, self.degree + 1), 3)
        parameters = (
            Hyperparameter(FIRST, upper=np.log(LONGEST**2), by_root=True),
            Hyperparameter(FREQUENCY, np.log(LOWEST_FREQUENCY), np.log(max(self.degree, 1))),
            Hyperparameter(STEEP, *STEEPNESS),
        )
        slopes = np.repeat([[1.0, 0.0, 0.0]], len(order), axis=0)
        law = Prior(np.zeros(len(order)), slopes, parameters, SCATTER, Trend(_decrease, (1, 2)), order)
        return Prior.none(3).joined(law)

    def omitted_variance(self, theta: FloatArray) -> float:
        """The mean variance of a coordinate, m², due to degrees beyond the highest, for the prior's parameters (3,)."""
        order = np.arange(self.degree + 1.0, 2 * self.degree + 1)
        return float(np.exp(theta[0] + _decrease(order, theta[1:])[0]).sum()) / 2


def _decrease(order: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The logarithms (k,) of the variances of coefficients over that of the first, and their derivatives (k, 2).

    order (k,): j of each; at (2,): t and the steepness s. They are −2 s (g(j) − g(1)) − 2 λ (j − 1) − 2 p ln(j/x),
    with g = 0 and no power for j ≤ x, and g = j arcosh(j/x) − √(j² − x²) beyond, as Bessel's Jⱼ(x) decreases with
    e^(−g). x is eᵗ and λ zero where t is greater than zero, and x is 1 and λ is −t where it is less, but for a smooth
    transition: for s = 1 these are one law, as g(j) − g(1) grows by (j − 1) ln(1/x) for a smaller x. For s = 0 it is
    that of coefficients ρ^−j j^−p with λ = ln ρ, those of a function whose nearest branch points are on the ellipse of
    ρ about ±1.

    Source: Abramowitz and Stegun 1964, 9.1.44, 9.1.45 and 9.3.7; Trefethen 2019, Approximation Theory and
    Approximation Practice, chapter 8.
    """
    t, steepness = map(float, at)
    log_x = max(t, 0.0) + math.log1p(math.exp(-SHARPNESS * abs(t))) / SHARPNESS  # positive, so that g(1) is zero
    x, rate, wave = math.exp(log_x), log_x - t, math.exp(SHARPNESS * (t - log_x))  # wave: its share in the transition
    beyond, after = np.maximum(order, x), order - 1
    root, ratio = np.sqrt((beyond - x) * (beyond + x)), beyond / x
    g = beyond * np.arccosh(ratio) - root
    by_t = wave * (steepness * root + POWER * (order > x)) + (1 - wave) * after  # −root is the derivative of g by ln x
    return -2 * (steepness * g + rate * after + POWER * np.log(ratio)), 2 * np.column_stack([by_t, -g])
