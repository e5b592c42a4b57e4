"""An unknown torque on a rigid body, as angular acceleration in body axes: a series of modes in time.

White noise of density q over T seconds is Σ ξⱼ aⱼ(t) with any orthonormal basis aⱼ of L²(0, T) and independent ξⱼ of
variance q. Here a₀ = √(1/T) and aⱼ = √(2/T) cos(jπt/T). A constant torque is the first of them.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.paths.polynomials import lagrange_weights
from baryscope.estimator.paths.process_noise import lasting_variance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FADES = 0.5  # standard deviation of how much of a torque that lasts goes on, as a share of it
POINTS = 4  # of a step, at which the torque is evaluated: Gauss and Legendre's; between them it is a cubic
GAUSS = (np.polynomial.legendre.leggauss(POINTS)[0] + 1) / 2  # as fractions of the step


@dataclass(frozen=True, eq=False)
class Torque:
    """Angular acceleration in B, J⁻¹ times the torque: Σ ξⱼ aⱼ(t), rad/s², over begin … end in s.

    coefficients (k, 3): ξⱼ of the three axes, rad/s^1.5; orders (k,): the modes' j, ascending. Before begin and after
    end it stays for half a wave of the last mode, so that a step of integration may pass them, and is zero from there.
    """

    begin: float
    end: float
    coefficients: FloatArray
    orders: IntArray

    @classmethod
    def none(cls, begin: float, end: float, orders: IntArray) -> "Torque":
        """No torque, but the modes of which the sensitivities are wanted."""
        return cls(begin, end, np.zeros((len(orders), 3)), orders)

    def with_orders(self, orders: IntArray) -> "Torque":
        """The same torque with other modes, which include those it has."""
        coefficients = np.zeros((len(orders), 3))
        coefficients[np.searchsorted(orders, self.orders)] = self.coefficients
        return replace(self, coefficients=coefficients, orders=orders)

    @classmethod
    def constant(cls, acceleration: FloatArray, begin: float, end: float) -> "Torque":
        """A torque that keeps its place in the body: acceleration (3,), rad/s²."""
        return cls(begin, end, np.sqrt(end - begin) * acceleration[None], np.zeros(1, dtype=np.intp))

    @property
    def size(self) -> int:
        """The number of coefficients, three of each mode."""
        return self.coefficients.size

    @property
    def highest_frequency(self) -> float:
        """The angular frequency of the last mode, rad/s."""
        return float(np.pi * self.orders[-1] / (self.end - self.begin))

    def changed(self, change: FloatArray) -> "Torque":
        """The torque with a change (3 k,) of the coefficients."""
        return replace(self, coefficients=self.coefficients + change.reshape(-1, 3))

    def modes(self, time: FloatArray) -> FloatArray:
        """The modes aⱼ (..., k) at times (...) in s, in s^-½."""
        span = self.end - self.begin
        order = self.orders
        scaled = (time - self.begin) / span
        inside = np.clip(scaled, 0.0, 1.0)
        found = np.cos(np.pi * order * inside[..., None]) * np.sqrt(np.where(order > 0, 2.0, 1.0) / span)
        beyond = np.abs(scaled - inside) * max(int(order[-1]), 1) > 1
        return np.asarray(np.where(beyond[..., None], 0.0, found))

    def at(self, time: FloatArray) -> FloatArray:
        """The angular acceleration (..., 3) at times (...) in s, rad/s² in B."""
        return np.asarray(self.modes(time) @ self.coefficients)

    def impulse(self) -> float:
        """The integral of its magnitude over time, rad/s: no rate changes by more."""
        time = np.linspace(self.begin, self.end, 8 * int(self.orders[-1]) + 9)
        return float(np.linalg.norm(self.at(time), axis=1).mean() * (self.end - self.begin))


@dataclass(frozen=True, eq=False)
class LastingTorque:
    """What of a torque goes on beyond the tracks: the mean (3,) of an angular acceleration that stays in B, rad/s², and
    its covariance (3, 3).
    """

    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, change: FloatArray, covariance: FloatArray, density: float, duration: float) -> "LastingTorque | None":
        """The lasting part of a torque that has changed the rate by (3,) rad/s in B over a duration in s.

        covariance (3, 3): of that change; density: of white noise, rad²/s³. Of what is beyond that, see
        `lasting_variance`, as by eddy currents or by light, more or less goes on. None if nothing is.
        """
        lasts, noise = lasting_variance(change, density, duration), density / duration
        if not (lasts > 0 and noise > 0):
            return None
        share = lasts / (lasts + noise)
        mean = share * change / duration
        own = share**2 * covariance / duration**2 + share * noise * np.eye(3)
        return cls(mean, own + FADES**2 * np.outer(mean, mean))


def stage_weights(fraction: float) -> FloatArray:
    """The weights (POINTS,) of the values at GAUSS in the cubic through them, at a fraction of the step."""
    return np.asarray(lagrange_weights(GAUSS, np.array([fraction]))[0])
