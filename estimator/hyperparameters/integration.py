"""The posterior over the uncertainty of the hyperparameters, whose evidence is that of `evidence`."""

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from baryscope.estimator.hyperparameters.evidence import (
    BELOW,
    NO_EFFECT,
    GaussianLikelihood,
    conditional,
    cost,
    curvature,
    held,
    likeliest_without,
    maximise,
    ranges,
)
from baryscope.estimator.hyperparameters.mixture import Mixture, Reduced
from baryscope.estimator.paths.prior import Alternative, Prior

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

GRID_STEP = 0.7  # in the integration over a hyperparameter's uncertainty: of its logarithm, at most
MOST_DEVIATIONS = 2.0  # of its own, of such a step
MOST_STEPS = 60  # of it, either way
LATTICE_STEP = 1.2  # standard deviations, in the integration over several hyperparameters
MOST_POINTS = 1500  # of that lattice
EDGE = 1e-6  # of a logarithm: beyond a bound by rounding
MOST_DEVIATION = 2.0  # of a combination of hyperparameters, for the length of a step
LEAST_EFFECT = 1.0  # prior variance times information, from which an optional hyperparameter is not as good as none
CLAIMED = 0.8  # probability that an optional hyperparameter is no greater than that of the claimed covariance
BEYOND = 0.05  # probability of an error outside of the region that is to hold most
EXCLUDED = 300.0  # ln of odds, beyond which they no longer matter
GRID_END = 12.0  # increase of −2 ln p at which this integration ends
NINETY = 1.645  # standard deviations either way that hold 90 %


@dataclass(frozen=True, eq=False)
class Posterior:
    """Hyperparameters θ (h,) at the maximum, and the posterior of x over their uncertainty.

    mean (p,) and covariance (p, p) of x; likeliest (p,): x for θ itself; information (p,): of the observations alone on
    each unknown.

    Of a hyperparameter that has its unknowns for itself, NaN of others: interval (h, 2) of a standard deviation either
    way; significance (h,): 2 ln p of θ less that at the lower bound of the range, where it has no effect; expectation
    (h,): the mean of exp θ.
    """

    theta: FloatArray
    interval: FloatArray
    significance: FloatArray
    expectation: FloatArray
    mean: FloatArray
    covariance: FloatArray
    likeliest: FloatArray
    information: FloatArray

    @property
    def about_likeliest(self) -> FloatArray:
        """The second moment (p, p) of x about that for θ itself."""
        apart = self.mean - self.likeliest
        return self.covariance + np.outer(apart, apart)

    def bounds(self, index: int) -> tuple[float, float]:
        """The bounds of exp θ of a hyperparameter that hold 90 %, and its value at the maximum."""
        centre, deviation = self.interval[index].mean(), np.ptp(self.interval[index]) / 2
        low, high = np.exp([centre - NINETY * deviation, centre + NINETY * deviation])
        best = float(np.exp(self.theta[index]))
        return min(float(low), best), max(float(high), best)


def posterior(linear: GaussianLikelihood, prior: Prior, theta: FloatArray) -> Posterior:
    """The posterior of x, over the uncertainty of the hyperparameters about θ (h,), with the prior's scatter.

    One that has its unknowns for itself is integrated alone, others along the principal axes of −2 ln p, on a grid
    (Rue, Martino and Chopin 2009, J. R. Statist. Soc. B 71, § 4).

    What is optional is either nothing, or has an effect. Where the observations do not tell which, a mean of the two
    covariances would be claimed in either case, and an error that one of them explains is beyond it too often: so the
    covariance for given hyperparameters is that of their CLAIMED quantile.

    What vanishes is nothing as likely as not, and so are a prior and an alternative to it. Both have their weight in
    the mean; the share of either in the covariance is that of `_claimed_share`.

    θ is that of a prior which holds what is not typical for nearly impossible, as a search needs that is not to follow
    outliers. Where the observations tell it all the same, the claim must not be too small by that: here it is tolerant.
    """
    prior = replace(prior, tolerant=True)
    best = _Best(linear, prior, theta, ranges(linear, prior), *conditional(linear, prior, theta))
    mean, total = best.mean.copy(), best.covariance.copy()
    interval = np.full((len(theta), 2), np.nan)
    significance, expectation = np.full(len(theta), np.nan), np.full(len(theta), np.nan)
    shared = prior.uses.sum(axis=1) > 1
    joint = (prior.uses & shared[:, None]).any(axis=0)
    for index in np.flatnonzero(~joint):
        one = _over_one(best, int(index))
        interval[index], significance[index], expectation[index] = one.interval, one.significance, one.expectation
        total += _positive(one.of_x - best.covariance, np.diag(best.covariance))
        mean += one.mean - best.mean
    share = 1.0  # of what may vanish in the covariance
    if joint.any():
        mixture, share = _over_several(best, joint)
        total += mixture.within + mixture.between - best.covariance
        mean += mixture.mean - best.mean
    for alternative in prior.alternatives:
        mixture = _of_both(linear, prior, theta, alternative)
        total += mixture.within + mixture.between - best.covariance
        mean += mixture.mean - best.mean
    if np.any(prior.scatter):
        total += share * best.scatter
    covariance, information = (total + total.T) / 2, np.diag(linear.information)
    return Posterior(theta, interval, significance, expectation, mean, covariance, best.mean, information)


@dataclass(frozen=True, eq=False)
class _Best:
    """The likeliest hyperparameters θ (h,), within bounds (h, 2), and the posterior of x for them.

    mean (p,) and covariance (p, p) of x.
    """

    linear: GaussianLikelihood
    prior: Prior
    theta: FloatArray
    bounds: FloatArray
    mean: FloatArray
    covariance: FloatArray

    @property
    def scatter(self) -> FloatArray:
        """What the prior's scatter adds to the covariance, (p, p)."""
        root = np.sqrt(held(self.linear, self.prior, self.theta)[0])
        prior, axes = self.prior.scattered(root[:, None] * self.covariance * root)
        wider = axes @ conditional(self.linear.along(axes), prior, self.theta)[1] @ axes.T
        return _positive(wider - self.covariance, np.diag(self.covariance))


@dataclass(frozen=True, eq=False)
class _Single:
    """The posterior over one hyperparameter that has its unknowns for itself.

    interval, significance and expectation as in `Posterior`; mean (p,) of x, and the covariance (p, p) to be claimed.
    """

    interval: tuple[float, float]
    significance: float
    expectation: float
    mean: FloatArray
    of_x: FloatArray


def _over_one(best: _Best, index: int) -> _Single:
    """The integration over one hyperparameter, by its index, on a grid in its logarithm."""
    linear, prior, theta, bounds = best.linear, best.prior, best.theta, best.bounds
    step = _step(linear, prior, theta, index)
    points, costs = _along(linear, prior, theta, step * np.eye(len(theta))[index], bounds)
    weight = np.exp(-(np.array(costs) - min(costs)) / 2)
    lowest, none = likeliest_without(linear, prior, theta, index, bounds)
    optional = prior.hyperparameters[index].optional
    if optional:  # the room below, where all is as at the lower bound
        least = bounds[index, 0] + np.log(LEAST_EFFECT / NO_EFFECT)
        weight[[at[index] < least for at in points]] = 0.0
        points.append(lowest)
        weight = np.append(weight, BELOW / step * np.exp(-max(none - min(costs), 0.0) / 2))
        if not weight.any():  # rounding makes −2 ln p fall where nothing has an effect
            weight[-1] = 1.0
    weight /= weight.sum()
    values = np.array([at[index] for at in points])
    centre = float(weight @ values)
    deviation = float(np.sqrt(weight @ (values - centre) ** 2))
    mixture = Mixture.of(linear, prior, points, weight)
    of_x = mixture.within
    if optional:
        order = np.argsort(values)
        quantile = order[int(np.searchsorted(weight[order].cumsum(), CLAIMED))]
        of_x = conditional(linear, prior, points[quantile])[1]
    return _Single(
        interval=(centre - deviation, centre + deviation),
        significance=none - costs[0],  # the first is that of θ
        expectation=float(weight @ np.exp(values)),
        mean=mixture.mean,
        of_x=of_x + mixture.between,
    )


def _over_several(best: _Best, joint: BoolArray) -> tuple[Mixture, float]:
    """The integration over the hyperparameters (h,) that share unknowns, on a lattice along their principal axes.

    With the share, in the covariance, of what may vanish; 1 if nothing may.
    """
    prior, theta, bounds = best.prior, best.theta, best.bounds
    few = Reduced.of(best.linear, prior, theta, np.any(prior.uses[:, joint], axis=1))
    steps = _principal_steps(few.linear, few.prior, theta, joint, bounds)
    points, costs = _lattice(few.linear, few.prior, theta, steps, bounds)
    at_ends = np.abs(np.array(points)[:, None] - bounds.T).min(axis=1) <= EDGE
    # By the trapezoidal rule; one without a range is at its ends in all points.
    weight = np.exp(-(np.array(costs) - min(costs)) / 2) * 0.5 ** at_ends.sum(axis=1)
    mixture = few.whole(Mixture.of(few.linear, few.prior, points, weight / weight.sum()))
    vanishing = [int(index) for index in np.flatnonzero(joint) if prior.hyperparameters[index].vanishing]
    if not vanishing:
        return mixture, 1.0
    mass = weight.sum() * _cell(steps, np.ptp(bounds, axis=1), vanishing[0]) / BELOW
    still, less = _without(few.linear, few.prior, theta, vanishing[0], bounds)
    nothing = 1 / (1 + mass * np.exp(min((less - min(costs)) / 2, EXCLUDED)))
    share = _claimed_share(1 - nothing)
    other = few.whole(Mixture.of(few.linear, few.prior, [still], np.ones(1)))
    return mixture.or_else(other, nothing, share), share


def _of_both(linear: GaussianLikelihood, prior: Prior, theta: FloatArray, other: Alternative) -> Mixture:
    """The posterior of x for θ (h,) or for another explanation, with the hyperparameters that are likeliest there."""
    instead = prior.instead(other)
    there = maximise(linear, instead, theta)
    probability = 1 / (1 + np.exp(min((cost(linear, instead, there) - cost(linear, prior, theta)) / 2, EXCLUDED)))
    own, others = (Mixture.of(linear, at, [where], np.ones(1)) for at, where in ((prior, theta), (instead, there)))
    if np.trace(own.within) < np.trace(others.within):
        own, others, probability = others, own, 1 - probability
    return own.or_else(others, probability, _claimed_share(1 - probability))


def _without(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, index: int, bounds: FloatArray
) -> tuple[FloatArray, float]:
    """θ (h,) where one hyperparameter is at its lower bound, without an effect; and −2 ln p there, with the density of
    that hyperparameter's own prior at θ.
    """
    without = theta.copy()
    without[index] = bounds[index, 0]
    by_root = float(prior.hyperparameters[index].by_root)
    return without, cost(linear, prior, without) + by_root * float(without[index] - theta[index])


def _claimed_share(probability: float) -> float:
    """The share, in the covariance of two explanations, of the one whose errors are by far the greater, by its
    probability: with it, errors of three coordinates are outside of the region of 1 - BEYOND as often as BEYOND.
    """
    return float(chdtri(3, min(BEYOND / max(probability, BEYOND), 1.0)) / chdtri(3, BEYOND))


def _cell(steps: FloatArray, width: FloatArray, index: int) -> float:
    """The volume of a cell of steps (k, h), over the widths (h,) of the ranges of all hyperparameters but one."""
    others = steps.any(axis=0) & (np.arange(len(width)) != index)
    return float(np.sqrt(np.linalg.det(steps @ steps.T)) / width[others].prod())


def _step(linear: GaussianLikelihood, prior: Prior, theta: FloatArray, index: int) -> float:
    """The step of the integration over one hyperparameter: few where the observations tell it well."""
    curved = float(curvature(linear, prior, theta)[2][index, index]) / 2  # of −ln p
    return min(GRID_STEP, MOST_DEVIATIONS / np.sqrt(curved)) if curved > 0 else GRID_STEP


def _principal_steps(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, joint: BoolArray, bounds: FloatArray
) -> FloatArray:
    """Steps (k, h) along the principal axes of −2 ln p in k hyperparameters, joint (h,), of LATTICE_STEP deviations.

    One that is at a bound has its own, so that no axis leads out of its range at once; one without a range has none.
    """
    width = np.ptp(bounds, axis=1)
    at_bound = (theta <= bounds[:, 0] + EDGE) | (theta >= bounds[:, 1] - EDGE)
    within, ranging, axes = np.flatnonzero(joint & ~at_bound), joint & at_bound & (width > 0), np.eye(len(theta))
    values, vectors = np.linalg.eigh(curvature(linear, prior, theta)[2][np.ix_(within, within)] / 2)
    values = np.clip(values, MOST_DEVIATION**-2, None)
    steps = np.zeros((len(within), len(theta)))
    steps[:, within] = LATTICE_STEP * (vectors / np.sqrt(values)).T
    crossing = width[ranging] / np.ceil(width[ranging] / LATTICE_STEP)
    return np.concatenate([steps, crossing[:, None] * axes[ranging]])


def _lattice(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, steps: FloatArray, bounds: FloatArray
) -> tuple[list[FloatArray], list[float]]:
    """θ (h,), and the points of a lattice of steps (k, h) about it, as far as −2 ln p is not much greater; and that."""
    points, costs = [theta], [cost(linear, prior, theta)]
    reached = {(0,) * len(steps)}
    border, moved = list(reached), steps.any(axis=0)
    while border and len(points) < MOST_POINTS:
        beyond = sorted(set(chain.from_iterable(map(_neighbours, border))) - reached)
        reached.update(beyond)
        border = []
        for node in beyond:
            at = theta + np.array(node) @ steps
            if np.any(moved & ((at < bounds[:, 0] - EDGE) | (at > bounds[:, 1] + EDGE))):
                continue
            value = cost(linear, prior, at)
            if value <= min(costs) + GRID_END:
                points.append(at)
                costs.append(value)
                border.append(node)
    return points, costs


def _neighbours(node: tuple[int, ...]) -> list[tuple[int, ...]]:
    return [(*node[:k], node[k] + way, *node[k + 1 :]) for k in range(len(node)) for way in (-1, 1)]


def _along(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, step: FloatArray, bounds: FloatArray
) -> tuple[list[FloatArray], list[float]]:
    """θ (h,), and points in steps (h,) either way as far as −2 ln p is not much greater, within bounds; and that."""
    points, costs = [theta], [cost(linear, prior, theta)]
    moved = step != 0
    for sign in (-1, 1):
        for k in range(1, MOST_STEPS):
            at = theta + sign * k * step
            if np.any((at < bounds[:, 0]) & moved) or np.any((at > bounds[:, 1]) & moved):
                break  # the others were held within bounds of an earlier linearisation, which differ by rounding
            value = cost(linear, prior, at)
            if value > min(costs) + GRID_END:
                break
            points.append(at)
            costs.append(value)
    return points, costs


def _positive(matrix: FloatArray, variance: FloatArray) -> FloatArray:
    """The positive semidefinite part (p, p) of a symmetric matrix, in units of variances (p,)."""
    scale = np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    half = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(half @ half.T)
