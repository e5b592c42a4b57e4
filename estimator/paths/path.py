"""Models of the path of the centre of mass in C: what they have in common, and fixed points and polynomials in time.

Each has a few unknowns x, and can be sampled at given times (`sampled_path`). Fixed points and polynomials are linear
in x. Relative motion stands in `relative_motion`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from baryscope.estimator.paths.prior import Hyperparameter, Prior, Trend
from baryscope.estimator.paths.sampled_path import IsotropicPath, SampledPath

FloatArray = NDArray[np.float64]

FIXED = "fixed"
FIRST, FREQUENCY, OVERTONES = "first coefficient", "frequency", "overtones"  # the names of hyperparameters
LOWEST_FREQUENCY = 1e-2  # of a smooth path's coefficients, rad in half the time span
DECAY = (0.0, 10.0)  # of overtones: minus the logarithm of the ratio of one to the one before
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

    def at(self, time: FloatArray) -> SampledPath:
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

    def rate_at(self, time: FloatArray) -> SampledPath:
        """The velocity at times (n,) in s: a sampled path in m/s instead of m."""
        ...

    def gravity_gradient(self, time: FloatArray) -> FloatArray | None:
        """The gravity gradient (n, 3, 3) along the orbit in C, 1/s²; None if the model has none."""
        ...


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
        """The frequency of the highest polynomial T_d, in the middle or at the ends, where T_d(1 − y) ≈ cos √(2 d² y).

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
        return IsotropicPath(terms)


@dataclass(frozen=True)
class SmoothPath(Polynomial):
    """A smooth path: Chebyshev polynomials up to a high degree whose coefficients decrease as those of orbits do.

    A wave of x rad in half the time span has coefficients ±2 Jⱼ(x): as large up to j = x, and beyond, less than any
    power. On an ellipse it has overtones, each less than the one before by a ratio, whose coefficients decrease by a
    constant ratio from some j on: as ρ^−j j^(−5/3), with the branch points of Kepler's motion on the Bernstein ellipse
    of ρ. The law of the standard deviations has both (`_decrease`). The variance of the first coefficient, frequency or
    rate, and the decay of the overtones are hyperparameters. They take the place of the choice of a degree, with its
    uncertainty. Each coefficient that the tracks do not tell may break the law, for all that follow.
    """

    @property
    def name(self) -> str:
        """The model's name, as on the command line."""
        return "polynomial"

    @cached_property
    def prior(self) -> Prior:
        """The prior of the coefficients; the constant has none."""
        order = np.repeat(np.arange(1.0, self.degree + 1), 3)
        parameters = (
            Hyperparameter(FIRST, upper=np.log(LONGEST**2), by_root=True, vanishing=True),
            Hyperparameter(FREQUENCY, np.log(LOWEST_FREQUENCY), np.log(max(self.degree, 1))),
            Hyperparameter(OVERTONES, *DECAY),
        )
        slopes = np.repeat([[1.0, 0.0, 0.0]], len(order), axis=0)
        law = Prior(np.zeros(len(order)), slopes, parameters, SCATTER, Trend(_decrease, (1, 2)), order)
        return Prior.none(3).joined(law)

    def omitted_variance(self, theta: FloatArray) -> float:
        """The mean variance of a coordinate, m², due to degrees beyond the highest, for the prior's parameters (3,)."""
        order = np.arange(self.degree + 1.0, 2 * self.degree + 1)
        return float(np.exp(theta[0] + _decrease(order, theta[1:])[0]).sum()) / 2


def _decrease(order: FloatArray, at: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
    """The logarithms (k,) of the variances of coefficients over that of the first, and what finds their derivatives
    (2, k).

    order (k,): j of each; at (2,): t, and the decay η of overtones. They are −2 G(j) − 2 λ (j − 1) − 2 p ln(j/x),
    without the power for j ≤ x. G is zero up to j = x; beyond, it is g = j arcosh(j/x) − √(j² − x²), as Bessel's Jⱼ(x)
    decreases with e^(−g), up to the knee √(x² + η²), and from there on the tangent j arsinh(η/x) − η. That is the least
    over all k ≥ 1 of η (k − 1) + g for k x in the place of x: of overtones of k times the frequency, e^(−η (k − 1)) as
    large as the wave, the greatest coefficient. x is eᵗ and λ zero where t is greater than zero, and x is 1 and λ is
    −t where it is less, but for a smooth transition: for a wave these are one law, as g(j) − g(1) grows by
    (j − 1) ln(1/x) for a smaller x. For η = 0 it is that of coefficients ρ^−j j^−p with λ = ln ρ, those of a function
    whose nearest branch points are on the ellipse of ρ about ±1.

    Source: Abramowitz and Stegun 1964, 9.1.44, 9.1.45 and 9.3.7; Trefethen 2019, Approximation Theory and
    Approximation Practice, chapter 8.
    """
    t, decay = map(float, at)
    log_x = max(t, 0.0) + math.log1p(math.exp(-SHARPNESS * abs(t))) / SHARPNESS  # positive, so that g(1) is zero
    x, rate, wave = math.exp(log_x), log_x - t, math.exp(SHARPNESS * (t - log_x))  # wave: its share in the transition
    beyond, after = np.maximum(order, x), order - 1
    root, ratio = np.sqrt((beyond - x) * (beyond + x)), beyond / x
    knee, slope = math.hypot(x, decay), math.asinh(decay / x)
    tail = order > knee
    G = np.where(tail, order * slope - decay, beyond * np.arccosh(ratio) - root)

    def derivatives() -> FloatArray:
        by_log_x = np.where(tail, order * math.tanh(slope), root)  # −∂G
        by_t = wave * (by_log_x + POWER * (order > x)) + (1 - wave) * after
        by_decay = np.where(tail, 1 - order / knee, 0.0)
        return 2 * np.array([by_t, by_decay])

    return -2 * (G + rate * after + POWER * np.log(ratio)), derivatives
