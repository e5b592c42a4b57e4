"""What the variances of groups of functions in the noise may be, all together, and the unknowns with each.

What the residuals show may be of one group of functions or of another, as functions of one motion look alike; the rest
of each, which the unknowns explain, is then as large as the group's variance makes it. So the variances are integrated
over together, weighted by the restricted likelihood (Box and Tiao, Bayesian Inference in Statistical Analysis, 1973,
for one variance). The prior: each group is there or not, as likely as not. The variance of one that is there is
log-uniform, from that with which the one combination of its functions that would show best were as large as its noise,
as less than that changes neither unknowns nor residuals, up to functions as large as anything can be. (Log-uniform down
to nothing is "none" by as much as one chooses to count of that; from the noise on, without "none", it doubles the
covariance where no such function is.)

Groups are taken out of the normal equations one after the other, each for all of its variances at once, along the axes
of what is left of its information.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from baryscope.estimator.tracks import FloatArray, IntArray

UNKNOWN, KNOWN = -1, -2  # the groups of the unknowns, and of functions whose coefficients have the variance 1
ROUNDED = 1e-10  # of a group's greatest information: less is rounding
REGULAR = 1e-14  # of the greatest eigenvalue of scaled normal equations: less is rounding, too
ABSENT = 0.5  # probability that a group of functions is not there
COARSE = 8  # variances of a group that are tried to find out which count
COMBINATIONS = 4096  # of variances that are weighted, about
MOST, LEAST = 33, 5  # variances of a group in these
STEP = 2.0  # ratio of one variance to the next that is fine enough
LEAST_SHARE = 1e-3  # of the covariance by noise alone, about, that variances which count add to it


@dataclass(frozen=True, eq=False)
class Possible:
    """Combinations of the groups' variances (t, g), with weights (t,), whose sum is 1; and with each of them the mean
    (t, p) and covariance (t, p, p) of the unknowns.
    """

    weight: FloatArray
    variances: FloatArray
    mean: FloatArray
    covariance: FloatArray

    def about(self, found: FloatArray) -> FloatArray:
        """The second moments (p, p) of the unknowns about those found (p,)."""
        away = self.mean - found
        return np.asarray(np.tensordot(self.weight, self.covariance, axes=1) + (away.T * self.weight) @ away)


def possible_variances(matrix: FloatArray, rhs: FloatArray, group: IntArray, largest: FloatArray) -> Possible:
    """What the variances may be by normal equations of unknowns and coefficients, matrix (q, q) and rhs (q,).

    group (q,): whose coefficient it is, from 0, or UNKNOWN or KNOWN; largest (g,): variances of a group at most.
    """
    whole, information = _Left.of(matrix, rhs, group)
    least = np.minimum(1 / np.maximum(information, 1e-300), largest)
    tried = [_values(*ends) for ends in zip(least, largest, strict=True)]
    fine = max(LEAST, min(MOST, int(COMBINATIONS ** (1 / max(len(largest), 1)))))
    likely = _weighted(whole.without_unknowns().over([one.variance for one in tried], information), tried)
    chosen = [_narrowed(one, likely, axis, fine) for axis, one in enumerate(tried)]
    left = whole.over([one.variance for one in chosen], information)
    weight = _weighted(left, chosen).ravel()
    combinations = np.array(list(product(*[one.variance for one in chosen])))
    return Possible(weight / weight.sum(), combinations, left.mean, left.covariance)


@dataclass(frozen=True, eq=False)
class _Values:
    """Variances (t,) of a group, the first 0, with their shares (t,) of the prior.

    density: that of the prior in the variance's logarithm.
    """

    variance: FloatArray
    prior: FloatArray
    density: float


def _values(least: float, largest: float) -> _Values:
    """None at all and a few variances from the least to the largest."""
    width = float(np.log(largest / least))
    if width == 0:
        return _Values(np.array([0.0, largest]), np.array([ABSENT, 1 - ABSENT]), 0.0)
    return _between(least, largest, COARSE, (1 - ABSENT) / width)


def _between(least: float, largest: float, count: int, density: float) -> _Values:
    """None at all and so many variances by the trapezoidal rule, of a prior density in their logarithm."""
    prior = np.full(count, density * np.log(largest / least) / (count - 1))
    prior[[0, -1]] /= 2
    variance = np.geomspace(least, largest, count)
    return _Values(np.concatenate([[0.0], variance]), np.concatenate([[ABSENT], prior]), density)


def _narrowed(tried: _Values, likely: FloatArray, axis: int, fine: int) -> _Values:
    """More variances of a group, where those that were tried count, and their neighbours.

    likely: weights of all combinations that were tried, along the axes of the groups, the greatest being 1. The least
    variance may add to the covariance as much as noise has of it, others in proportion.
    """
    others = tuple(k for k in range(likely.ndim) if k != axis)
    added = likely.max(axis=others) * np.maximum(tried.variance / tried.variance[1], 1.0)
    counts = np.flatnonzero(added > LEAST_SHARE)
    begin, end = max(counts[0] - 1, 1), min(counts[-1] + 1, len(tried.variance) - 1)
    least, largest = tried.variance[begin], tried.variance[end]
    if begin == end:
        return tried
    count = int(np.ceil(np.log(largest / least) / np.log(STEP))) + 1
    return _between(least, largest, min(max(count, LEAST), fine), tried.density)


def _weighted(left: "_Left", chosen: Sequence[_Values]) -> FloatArray:
    """Prior times likelihood of all combinations, along the axes of the groups, the greatest being 1."""
    logarithm = left.likelihood.reshape([len(one.variance) for one in chosen])
    for axis, one in enumerate(chosen):
        logarithm = logarithm + np.log(one.prior).reshape([-1 if k == axis else 1 for k in range(len(chosen))])
    return np.asarray(np.exp(logarithm - logarithm.max()))


@dataclass(frozen=True, eq=False)
class _Left:
    """What is left of normal equations where t combinations of variances have been taken out.

    information (t, q, q) and rhs (t, q) of the coefficients that are left; the unknowns are mean (t, p) − lever
    (t, p, q) @ coefficients, of a covariance (t, p, p); likelihood (t,), its logarithm; group (q,).
    """

    information: FloatArray
    rhs: FloatArray
    lever: FloatArray
    mean: FloatArray
    covariance: FloatArray
    likelihood: FloatArray
    group: IntArray

    @classmethod
    def of(cls, matrix: FloatArray, rhs: FloatArray, group: IntArray) -> tuple["_Left", FloatArray]:
        """With unknowns and functions of known variance taken out; and the greatest information (g,) on a combination
        of the functions of each group, if the unknowns were known.
        """
        other = np.concatenate([np.flatnonzero(group == UNKNOWN), np.flatnonzero(group == KNOWN)])
        own = np.flatnonzero(group >= 0)
        p = int(np.sum(group == UNKNOWN))
        out = matrix[np.ix_(other, other)].copy()
        out.flat[p * (len(other) + 1) :: len(other) + 1] += 1.0
        sure = _inverse_root(out[p:, p:])
        crossed = sure.T @ matrix[np.ix_(other[p:], own)]
        alone = matrix[np.ix_(own, own)] - crossed.T @ crossed
        of_groups = [alone[np.ix_(group[own] == k, group[own] == k)] for k in range(group.max(initial=-1) + 1)]
        greatest = np.array([np.linalg.eigvalsh(one)[-1] for one in of_groups])
        root = _inverse_root(out)
        whitened, shown = root.T @ matrix[np.ix_(other, own)], root.T @ rhs[other]
        left = cls(
            (matrix[np.ix_(own, own)] - whitened.T @ whitened)[None],
            (rhs[own] - whitened.T @ shown)[None],
            (root[:p] @ whitened)[None],
            (root[:p] @ shown)[None],
            (root[:p] @ root[:p].T)[None],
            np.zeros(1),
            group[own],
        )
        return left, greatest

    def without_unknowns(self) -> "_Left":
        """The same of no unknowns, for the likelihood alone."""
        t, q = self.rhs.shape
        none = np.zeros((t, 0, q)), np.zeros((t, 0)), np.zeros((t, 0, 0))
        return _Left(self.information, self.rhs, *none, self.likelihood, self.group)

    def over(self, variances: Sequence[FloatArray], greatest: FloatArray) -> "_Left":
        """With all groups taken out, for all combinations of their variances, in the order of `itertools.product`."""
        left = self
        for k, of_group in enumerate(variances):
            left = left.without(k, of_group, ROUNDED * float(greatest[k]))
        return left

    def without(self, index: int, variances: FloatArray, rounded: float) -> "_Left":
        """With a group taken out, for each of its variances (v,) as for each combination (t,) before: (t v,).

        Along the axes of the group's information, of values λ, and of its right side, z: a coefficient has the
        covariance v/(1 + λ v), and the likelihood's logarithm has ½ (z² v/(1 + λ v) − ln(1 + λ v)). What is `rounded`
        is information that there is none.
        """
        own, rest = np.flatnonzero(self.group == index), np.flatnonzero(self.group != index)
        values, axes = np.linalg.eigh(self.information[:, own][:, :, own])
        shown = values > rounded
        values, axes_shown = np.where(shown, values, 0.0), axes * shown[:, None, :]
        z = np.einsum("tij,ti->tj", axes_shown, self.rhs[:, own])
        crossed = self.information[:, rest][:, :, own] @ axes_shown
        lever = self.lever[:, :, own] @ axes
        grown = 1 + values[:, None] * variances[:, None]
        covariance = variances[:, None] / grown
        mean = covariance * z[:, None]
        of_rest, of_lever = crossed[:, None] * covariance[:, :, None], lever[:, None] * covariance[:, :, None]
        parts = [
            self.information[:, rest][:, :, rest][:, None] - of_rest @ np.swapaxes(crossed, 1, 2)[:, None],
            self.rhs[:, None, rest] - mean @ np.swapaxes(crossed, 1, 2),
            self.lever[:, :, rest][:, None] - of_lever @ np.swapaxes(crossed, 1, 2)[:, None],
            self.mean[:, None] - mean @ np.swapaxes(lever, 1, 2),
            self.covariance[:, None] + of_lever @ np.swapaxes(lever, 1, 2)[:, None],
            self.likelihood[:, None] + 0.5 * np.sum(mean * z[:, None] - np.log(grown), axis=2),
        ]
        count = len(z) * len(variances)
        of_rest, rhs, lever, mean, covariance, likelihood = [part.reshape(count, *part.shape[2:]) for part in parts]
        return _Left(of_rest, rhs, lever, mean, covariance, likelihood, self.group[rest])


def _inverse_root(matrix: FloatArray) -> FloatArray:
    """S (q, q) of the inverse S Sᵀ of normal equations, of any units."""
    scale = 1 / np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    return np.asarray(scale[:, None] * vectors / np.sqrt(np.maximum(values, REGULAR * values.max(initial=0.0))))
