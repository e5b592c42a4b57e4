"""How much wider a claim is for what its covariance leaves out: misfits, burns out of view, an unchecked law."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

UNLIKELY = 0.005  # number of burns that are expected, below which none is reckoned with: as many answers may be wrong
LAWLESS = 2.0  # deviation of what nothing checks, over that by its law


@dataclass(frozen=True)
class BurnsBeyond:
    """Burns before and after begin … end, s, as those that were found between them, `rate` per s.

    Burns at random times change the velocity as white acceleration does, of which the trace of the density is the mean
    of their squared changes, `square` in (m/s)², over the time between them (Campbell's theorem). That is the variance
    over all draws: where less than one burn is expected, most have none, and some a whole one. So it is that of one
    there, unless one is unlikely.
    """

    begin: float
    end: float
    rate: float
    square: float

    def covariance(self, time: FloatArray) -> FloatArray:
        """The covariance (n, 6, 6) that they add to position and velocity at times (n,), in m and s."""
        away = beyond(time, self.begin, self.end)
        expected = self.rate * np.abs(away)
        of_velocity = np.where(expected > UNLIKELY, np.maximum(expected, 1.0), 0.0) * self.square / 3
        both = np.array([[away**2 / 3, away / 2], [away / 2, np.ones_like(away)]])
        return np.asarray(np.kron(np.moveaxis(of_velocity * both, 2, 0), np.eye(3)))


@dataclass(frozen=True)
class UncheckedLaw:
    """The law of a path that nothing checks before begin and after end, s.

    Of the variance along the `told` axes of which a position knows most, `within` is the greatest between them, m².
    """

    begin: float
    end: float
    told: int
    within: float

    def factor(self, time: FloatArray, covariance: FloatArray) -> FloatArray:
        """The factor (n,) on covariances at times (n,), of positions (n, 3, 3) there.

        What the law claims beyond, over what is claimed within, has twice the deviation.
        """
        variance = np.linalg.eigvalsh(covariance)[:, : self.told].sum(axis=1)
        grown = 1 - self.within / np.maximum(variance, self.within)
        return np.where(beyond(time, self.begin, self.end) == 0, 1.0, 1 + (LAWLESS**2 - 1) * grown)


@dataclass(frozen=True)
class Widening:
    """What a misfit adds to covariances: a factor on them, and variances of each coordinate of position and velocity.

    variance in m², of the velocity in (m/s)², which grows to a distance away from the observations. Before the misfit,
    burns: what is not seen of these, and law: where nothing checks it.
    """

    factor: float = 1.0
    variance: float = 0.0
    velocity: float = 0.0
    burns: BurnsBeyond | None = None
    law: UncheckedLaw | None = None

    def then(self, by: "Widening") -> "Widening":
        """This one, and what it gives widened by another."""
        velocity = by.factor * self.velocity + by.velocity
        burns, law = by.burns or self.burns, by.law or self.law
        return Widening(self.factor * by.factor, by.factor * self.variance + by.variance, velocity, burns, law)

    def of_position(self, covariance: FloatArray) -> FloatArray:
        """A covariance (..., 3, 3) of positions in m², widened."""
        return np.asarray(self.factor * covariance + self.variance * np.eye(3))

    def of_velocity(self, covariance: FloatArray) -> FloatArray:
        """A covariance (..., 3, 3) of velocities in (m/s)², widened."""
        return np.asarray(self.factor * covariance + self.velocity * np.eye(3))

    def of_both(self, covariance: FloatArray, time: FloatArray, begin: float, end: float) -> FloatArray:
        """A covariance (n, 6, 6) of position and velocity at times (n,), widened; begin, end: of the tracks, s."""
        found = covariance if self.burns is None else covariance + self.burns.covariance(time)
        factor = np.full(len(time), self.factor)
        if self.law is not None:
            factor *= self.law.factor(time, found[:, :3, :3])
        found, away, axes = factor[:, None, None] * found, beyond(time, begin, end), np.arange(3)
        found[:, axes, axes] += (self.variance + self.velocity * away**2)[:, None]
        found[:, axes, axes + 3] += (self.velocity * away)[:, None]
        found[:, axes + 3, axes] += (self.velocity * away)[:, None]
        found[:, axes + 3, axes + 3] += self.velocity
        return found


UNCHANGED = Widening()


def beyond(time: FloatArray, begin: float, end: float) -> FloatArray:
    """How far times (n,) are after the end, or, below zero, before the begin, in s; zero between them."""
    return np.asarray(time - np.clip(time, begin, end))
