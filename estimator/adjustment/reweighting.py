"""Robust weights: the probability that an observation is an inlier, given its residual.

The model is a mixture: inliers with Gaussian errors, and outliers. Few outliers are taken for uniformly distributed.
Many that are not far away blur the noise that the median shows, and hide below a gate for few. Where solutions begin,
the outliers are Gaussian, too, if the residuals tell so, with a share and a variance of their own, of maximum
likelihood (expectation maximisation; Dempster, Laird and Rubin 1977, J. R. Statist. Soc. B 39). Once a solution is
refined, what seem to be many outliers may be a path or a noise that the model does not hold, and few are assumed.

The weight is the posterior probability of the first; it falls from 1 to 0 around a gate, where it is 1/2, so gross
outliers have no influence.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.registration.noise import GATE, MEDIAN

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

REJECTED = 0.5  # weight below which an observation counts as rejected
WEIGHT_CHANGE_TOLERANCE = 1e-2  # relative change of the cost by a change of weights, up to which they are at rest
NEGLIGIBLE = 1e-9  # weight of a rejected observation: not zero, so that its residual is still computed
WIDTH = 15.0  # squared normalised residual below the gate at which the weight is 1 but for less than 1e-3
BEYOND, MANY = 11.345, 0.03  # squared residual over its variance that 1 % of inliers exceed; a share that is more
TELLING, MOST = 200, 10_000  # residuals, of which the mixture is found: least, and most
FARTHER = 4.0  # variance of outliers over that of inliers, at least
LARGEST_SHARE = 0.5  # of outliers
ROUNDS = 40  # of expectation maximisation
WORTH = 3.0  # in ln n, by which the outliers' variance and share must raise 2 ln p (2: Schwarz 1978, Ann. Statist. 6)


def rejects_many(weight: FloatArray) -> bool:
    """Whether many of the observations are outliers by their weights (n, m), zero where there is none."""
    return bool(np.mean(weight[weight > 0] < REJECTED) > MANY)


@dataclass(frozen=True)
class Mixture:
    """Inliers beside outliers: variance of an observation of weight 1; the squared residual over it, gate, at which
    both are as likely, and slope, by which −2 ln of the odds falls with it.
    """

    variance: float
    gate: float = GATE
    slope: float = 1.0

    @classmethod
    def few(cls, squares: FloatArray, share: float, least: float) -> "Mixture":
        """The mixture of squared residuals (k,) of weight 1, with the noise that the median shows.

        share: degrees of freedom over values, by which residuals are smaller than the noise; least: lower bound of the
        variance, for residuals that are rounding.
        """
        return cls(max(float(np.median(squares)) / (MEDIAN * share), least))

    @classmethod
    def of(cls, squares: FloatArray, share: float, least: float) -> "Mixture":
        """The mixture of residuals which may tell many outliers near by; see `few`."""
        usual = float(np.median(squares)) / (MEDIAN * share)
        if (
            usual > least
            and len(squares) >= TELLING
            and np.count_nonzero(squares > BEYOND * share * usual) > MANY * len(squares)
        ):
            found = _two_gaussians(squares[:: 1 + len(squares) // MOST], 3 * share, usual)
            if found is not None and found[0] > least:
                inliers, outliers, odds = found
                slope = 1 - inliers / outliers
                gate = (2 * np.log(odds) + 3 * share * np.log(outliers / inliers)) / slope
                return cls(inliers, min(gate, GATE), slope)
        return cls.few(squares, share, least)

    def weights(self, squares: FloatArray) -> FloatArray:
        """The probability (n, m) that observations of these squared residuals, for weight 1, are inliers."""
        found = np.ones_like(squares)
        if self.variance > 0:
            excess = self.slope * (squares / self.variance - self.gate)
            far = np.nonzero(excess > -WIDTH)
            found[far] = 1 / (1 + np.exp(np.minimum(excess[far] / 2, 20.0)))
        return found


def reweighted(
    squares: FloatArray, weight: FloatArray, dof: float, least: float = 0.0, *, many: bool = False
) -> FloatArray:
    """New weights (n, m) from weighted squared residuals and weights (n, m), 0 where there is no observation.

    dof: number of values less number of unknowns; least: see `Mixture.few`; many: whether there may be many outliers.
    """
    used = weight > 0
    plain = squares / np.where(used, weight, 1.0)
    share = dof / (3 * float(weight.sum()))
    mixture = (Mixture.of if many else Mixture.few)(plain[used], share, least)
    return np.where(used, mixture.weights(plain), 0.0)


def _two_gaussians(squares: FloatArray, dof: float, begin: float) -> tuple[float, float, float] | None:
    """Variances of inliers and of outliers, and how many inliers there are for an outlier; None if one does as well.

    squares (k,): each the variance times χ² of dof degrees of freedom; begin: the inliers' variance at first.
    """
    inliers, outliers, share = begin, max(float(squares.mean()) / dof, FARTHER * begin), 0.1
    for _ in range(ROUNDS):
        before = inliers, outliers, share
        odds = np.log(1 / share - 1) + dof / 2 * np.log(outliers / inliers) - squares * (1 / inliers - 1 / outliers) / 2
        wrong = 1 / (1 + np.exp(np.clip(odds, -50, 50)))
        share = min(float(wrong.mean()), LARGEST_SHARE)
        inliers = float((1 - wrong) @ squares) / max(dof * float((1 - wrong).sum()), 1e-300)
        outliers = max(float(wrong @ squares) / max(dof * float(wrong.sum()), 1e-300), FARTHER * inliers)
        if not (inliers > 0 and share > 0):
            return None
    _, then, among = before  # what the odds are of
    each = np.logaddexp(odds, 0.0) + np.log(among) - dof / 2 * np.log(then) - squares / (2 * then)
    gained = 2 * float(each.sum()) + len(squares) * dof * (np.log(float(squares.mean()) / dof) + 1)
    return (inliers, outliers, 1 / share - 1) if gained > WORTH * np.log(len(squares)) else None
