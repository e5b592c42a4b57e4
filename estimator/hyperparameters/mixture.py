"""Posteriors of x at several hyperparameters with weights, as one; and the likelihood of the few that these concern."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, conditional, held, solved
from baryscope.estimator.paths.prior import Prior

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Mixture:
    """Of the posteriors of x at several θ with weights: mean (p,), mean covariance (p, p), and that of their means."""

    mean: FloatArray
    within: FloatArray
    between: FloatArray

    @classmethod
    def of(cls, linear: GaussianLikelihood, prior: Prior, points: list[FloatArray], weight: FloatArray) -> "Mixture":
        """The mixture of the posteriors at the points; weights (k,) of sum 1."""
        means, within = [], np.zeros_like(linear.information)
        for share, at in zip(weight, points, strict=True):
            own, covariance = conditional(linear, prior, at)
            means.append(own)
            within += share * covariance
        mean = weight @ np.array(means)
        apart = np.array(means) - mean
        return cls(mean, within, (weight[:, None] * apart).T @ apart)

    def or_else(self, other: "Mixture", probability: float, claimed: float) -> "Mixture":
        """This mixture or another one, of which there is a probability; claimed: this one's share in the covariance."""
        apart = np.outer(other.mean - self.mean, other.mean - self.mean)
        own, others = self.between + probability**2 * apart, other.between + (1 - probability) ** 2 * apart
        return Mixture(
            (1 - probability) * self.mean + probability * other.mean,
            claimed * self.within + (1 - claimed) * other.within,
            claimed * own + (1 - claimed) * others,
        )


@dataclass(frozen=True, eq=False)
class Reduced:
    """A likelihood of the k unknowns z whose priors change, and their prior; others that have one are eliminated.

    The posterior of all, x (p,), given z, has the mean constant + along z, (p,) and (p, k), and the covariance given
    (p, p). So there are far fewer unknowns at each of many points, as where process noise has many modes.
    """

    linear: GaussianLikelihood
    prior: Prior
    constant: FloatArray
    along: FloatArray
    given: FloatArray

    @classmethod
    def of(cls, linear: GaussianLikelihood, prior: Prior, theta: FloatArray, changing: BoolArray) -> "Reduced":
        """For hyperparameters θ (h,) that stay, but for those that the priors of the changing unknowns (p,) have."""
        size, others = len(changing), ~(changing | prior.free)
        constant, along, given = np.zeros(size), np.eye(size)[:, ~others], np.zeros((size, size))
        if not others.any():
            return cls(linear, prior, constant, along, given)
        A, right = linear.information, linear.rhs + linear.information @ linear.x
        crossed = A[others][:, ~others]
        columns = np.column_stack([crossed, right[others], np.eye(int(others.sum()))])
        found = solved(A[others][:, others], columns, held(linear, prior, theta)[0][others])
        k = crossed.shape[1]
        along[others], constant[others], given[np.ix_(others, others)] = -found[:, :k], found[:, k], found[:, k + 1 :]
        own, x = A[~others][:, ~others] - crossed.T @ found[:, :k], linear.x[~others]
        own = (own + own.T) / 2
        few = GaussianLikelihood(own, right[~others] - crossed.T @ found[:, k] - own @ x, x)
        return cls(few, prior.of(np.flatnonzero(~others)), constant, along, given)

    def whole(self, found: Mixture) -> Mixture:
        """A mixture of the posteriors of z, as one of those of all unknowns."""
        between, within = (self.along @ one @ self.along.T for one in (found.between, found.within))
        return Mixture(self.constant + self.along @ found.mean, within + self.given, between)
