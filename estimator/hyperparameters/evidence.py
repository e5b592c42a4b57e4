"""Hyperparameters of a Gaussian prior from the observations, by the maximum of the marginal likelihood.

The model is linear in x (p,) near the current x: observations with information A on the change of x, a right-hand side
r, and the prior x ~ N(0, P⁻¹). All unknowns that are not in x have been eliminated. Then, up to a constant,

    −2 ln p(observations | θ) = ln det(A + P) − ln det P + xᵀP x − uᵀ(A + P)⁻¹u,  u = r − P x.

Its derivative by the logarithm of an unknown's variance is 1 − Pᵢ (Mᵢᵢ + mᵢ²), with M = (A + P)⁻¹ and m the posterior
mean. Source: MacKay, Neural Computation 4, 1992. θ is uniform within its bounds, that is, log-uniform in the density.

Unknowns that the prior fixes, as many of a smooth path's coefficients, are zero: they take no part in the algebra.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dsymm
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs, dtrtri

from baryscope.estimator.hyperparameters.bounded_minimum import bounded_minimum
from baryscope.estimator.hyperparameters.scan import scanned_minimum
from baryscope.estimator.paths.prior import Prior

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

NO_EFFECT = 1e-3  # prior variance times information, at which a hyperparameter's range begins
RANGE = 1e16  # of the variances, from there
FIRMEST = 1e6  # prior precision over information: that of an unknown that the prior fixes
RIDGE = 1e-13  # added to the scaled information, for directions without information and without a prior
BELOW = 10.0  # of the logarithm of an optional hyperparameter: its range without an effect
TYPICAL = 2.0  # width in which a likelihood with a maximum holds most of its mass
SCAN, SCAN_STEP = 16, 0.3  # values of a hyperparameter in the search for a start, at most, and how far apart at least
SWEEPS = 2  # of it, where there are several
MOST_STEPS = 100  # of the search for a minimum
FEW_STEPS = 4  # of them, where the next round goes on: far more lead away where outliers are not yet known
DIFFERENCE = 1e-4  # of a hyperparameter, for the change of the derivatives of a law
FINE_SCAN, FINE_SWEEPS = 101, 4  # values of a single one, and how often its range is narrowed to two steps


@dataclass(frozen=True, eq=False)
class GaussianLikelihood:
    """A likelihood of x (p,) in information form: A (p, p) and right-hand side (p,), both over their variance."""

    information: FloatArray
    rhs: FloatArray
    x: FloatArray
    _parts: "dict[bytes, tuple[GaussianLikelihood, float]]" = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def firmest(self) -> FloatArray:
        """The greatest precision (p,) of a prior: beyond, it fixes the unknowns."""
        size = np.diag(self.information)
        return np.asarray(np.maximum(FIRMEST * np.maximum(size, size.max() * RIDGE), 1e-200))

    @cached_property
    def squares(self) -> FloatArray:
        """The squares of x, (p,)."""
        return self.x * self.x

    def along(self, axes: FloatArray) -> "GaussianLikelihood":
        """The likelihood of x along other axes, the columns of an orthogonal matrix (p, p)."""
        return GaussianLikelihood(axes.T @ self.information @ axes, axes.T @ self.rhs, axes.T @ self.x)

    def among(self, loose: BoolArray) -> "tuple[GaussianLikelihood, float]":
        """The system of some unknowns (k,) where the others are zero, and what these add to xᵀP x − uᵀ(A + P)⁻¹u.

        The last one is kept, as most steps of a search ask for the same.
        """
        if loose.all():
            return self, 0.0
        which = loose.tobytes()
        if which not in self._parts:
            zeroed = np.where(loose, 0.0, self.x)
            turned = self.information @ zeroed
            rest = GaussianLikelihood(self.information[loose][:, loose], (self.rhs + turned)[loose], self.x[loose])
            self._parts.clear()
            self._parts[which] = rest, float(zeroed @ (turned + 2 * self.rhs))
        return self._parts[which]


def maximise(
    linear: GaussianLikelihood, prior: Prior, start: FloatArray | None = None, *, scan: bool = False
) -> FloatArray:
    """The hyperparameters (h,) of maximum marginal likelihood, from a start or from scans of their ranges.

    From a start (h,) the maximum near it is found, of those that are NaN there by a scan; all ranges are scanned beside
    it if asked for.
    """
    bounds = ranges(linear, prior)
    if not len(bounds):
        return np.zeros(0)
    if len(bounds) == 1 and prior.trend is None and np.all(prior.slopes[prior.slopes != 0] == 1):
        return _spared(linear, prior, _maximum_of_one(linear, prior, bounds[0]), bounds, scan=True)
    every = np.ones(len(bounds), dtype=bool)
    given = every if start is None else np.isnan(start)
    scan = scan or start is None
    near = bounds.mean(axis=1) if start is None else np.clip(np.where(given, bounds[:, 0], start), *bounds.T)
    # The better start may lie in a narrow valley that leads nowhere.
    costs: dict[bytes, float] = {}
    scans = [(near, given), (bounds[:, 0], every)] if scan else [(near, given)]
    scanned = [_scanned(linear, prior, bounds, at, unknown, costs) for at, unknown in scans]
    different = {at.tobytes(): at for at in scanned}  # often both are the same
    found = [_minimised(linear, prior, bounds, at) for at in different.values()]
    best, _ = min(found, key=lambda one: one[1])
    return _spared(linear, prior, best, bounds, scan=scan)


def improved(linear: GaussianLikelihood, prior: Prior, theta: FloatArray | None, *, scan: bool = False) -> FloatArray:
    """Hyperparameters (h,) that are likelier than θ (h,), after a few steps: for rounds that others follow.

    An optional one is not given up, even if it explains too little. Those of maximum likelihood, by scans of their
    ranges, too, where these are asked for, θ is None, or some of it NaN.
    """
    bounds = ranges(linear, prior)
    if scan or theta is None or len(bounds) < 2 or np.isnan(theta).any():
        return maximise(linear, prior, theta, scan=scan)
    return _minimised(linear, prior, bounds, np.clip(theta, bounds[:, 0], bounds[:, 1]), FEW_STEPS)[0]


def _minimised(
    linear: GaussianLikelihood, prior: Prior, bounds: FloatArray, start: FloatArray, most: int = MOST_STEPS
) -> tuple[FloatArray, float]:
    """The hyperparameters (h,) of the minimum of −2 ln p near a start (h,), within bounds (h, 2), and −2 ln p there."""
    return bounded_minimum(lambda at: _curved(linear, prior, at), start, bounds, most)


def _spared(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, bounds: FloatArray, *, scan: bool
) -> FloatArray:
    """θ (h,) without the optional hyperparameters that are less likely than none: their range has more room below.

    scan: search the others' whole ranges for what is likeliest without one.
    """
    for index, one in enumerate(prior.hyperparameters):
        if one.optional and theta[index] > bounds[index, 0]:
            without, least = likeliest_without(linear, prior, theta, index, bounds, scan=scan)
            theta = theta if least - cost(linear, prior, theta) > 2 * np.log(BELOW / TYPICAL) else without
    return theta


def likeliest_without(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray, index: int, bounds: FloatArray, *, scan: bool = True
) -> tuple[FloatArray, float]:
    """The likeliest θ (h,) where one hyperparameter is at its lower bound, and its −2 ln p.

    The others may be quite different there, as what one explains, others may explain as well: scan their ranges for
    them, or seek them from θ.
    """
    without = theta.copy()
    without[index] = bounds[index, 0]
    least = cost(linear, prior, without)
    others = np.delete(np.arange(len(theta)), index)
    if len(others) and theta[index] > bounds[index, 0]:
        rest = prior.fixed(prior.hyperparameters[index].name, float(bounds[index, 0]))
        found = without.copy()
        found[others] = maximise(linear, rest, theta[others], scan=scan)
        if (value := cost(linear, prior, found)) < least:
            return found, value
    return without, least


def _maximum_of_one(linear: GaussianLikelihood, prior: Prior, bounds: FloatArray) -> FloatArray:
    """The maximum for one hyperparameter that scales the variances of some unknowns, by one eigendecomposition.

    With λ the eigenvalues of these unknowns' information, scaled by the prior at θ = 0, and β the right-hand side along
    its axes, −2 ln p is Σ ln(1 + λ v) − β² v/(1 + λ v) for v = exp θ.
    """
    of = prior.slopes[:, 0] != 0
    rest = linear.information[~of][:, ~of] + np.diag(held(linear, prior, bounds[:1])[0][~of])
    crossed = linear.information[~of][:, of]
    absolute = linear.rhs + linear.information[:, of] @ linear.x[of]
    left = solved(rest, np.column_stack([crossed, absolute[~of]]))
    root = np.exp(prior.offset[of] / 2)
    scaled = (linear.information[of][:, of] - crossed.T @ left[:, :-1]) * np.outer(root, root)
    values, axes = np.linalg.eigh((scaled + scaled.T) / 2)
    values = np.maximum(values, 0.0)
    beta = (axes.T @ (root * (absolute[of] - crossed.T @ left[:, -1]))) ** 2

    def value(theta: FloatArray) -> FloatArray:
        grown = 1 + np.exp(theta)[:, None] * values
        terms = np.log(grown) - beta / (np.exp(-theta)[:, None] + values)
        return np.asarray(terms.sum(axis=1) + prior.penalty(theta[:, None])[0])

    return np.array([scanned_minimum(value, bounds[0], bounds[1], FINE_SCAN, FINE_SWEEPS)[0]])


def complexity(linear: GaussianLikelihood, prior: Prior, start: FloatArray | None = None) -> float:
    """−2 ln p at its minimum without the decrease uᵀ(A + P)⁻¹u, which is not to be had far from the solution.

    start (h,): hyperparameters from which the minimum is sought.
    """
    theta = maximise(linear, prior, start)
    precision = held(linear, prior, theta)[0]
    found = _minimum(linear, prior, precision)
    return float(found.determinants + precision @ linear.squares + prior.penalty(theta)[0])


def cost(linear: GaussianLikelihood, prior: Prior, theta: FloatArray) -> float:
    """−2 ln p of hyperparameters θ (h,), up to a constant."""
    return _minimum(linear, prior, held(linear, prior, theta)[0]).value + float(prior.penalty(theta)[0])


def ranges(linear: GaussianLikelihood, prior: Prior) -> FloatArray:
    """The bounds (h, 2) of the hyperparameters."""
    size = np.log(np.maximum(np.diag(linear.information), 1e-300))
    found = []
    for one, slope in zip(prior.hyperparameters, prior.slopes.T, strict=True):
        used = slope > 0
        first = np.log(NO_EFFECT) - np.max(size[used] + prior.offset[used], initial=-600.0)
        lower = first if one.lower is None else one.lower
        found.append((lower, lower + np.log(RANGE) if one.upper is None else max(one.upper, lower)))
    return np.array(found).reshape(-1, 2)


def _scanned(
    linear: GaussianLikelihood,
    prior: Prior,
    bounds: FloatArray,
    start: FloatArray,
    unknown: BoolArray,
    costs: dict[bytes, float],
) -> FloatArray:
    """A start for the maximum: one unknown hyperparameter after the other, over its range, twice.

    costs: of θ, by their bytes, which are found once and kept, as sweeps and starts come by the same ones.
    """
    theta = start.copy()
    for _ in range(1 if unknown.sum() == 1 else SWEEPS):
        for index in np.flatnonzero(unknown):
            low, high = bounds[index]
            values = np.linspace(low, high, min(SCAN, 1 + int(np.ceil((high - low) / SCAN_STEP))))
            found = []
            for value in values:
                theta[index] = value
                which = theta.tobytes()
                if which not in costs:
                    costs[which] = cost(linear, prior, theta)
                found.append(costs[which])
            theta[index] = values[int(np.argmin(found))]
    return theta


def held(linear: GaussianLikelihood, prior: Prior, theta: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The prior's precision (p,), at most FIRMEST times the information; and whose it is not, nor zero, (p,)."""
    precision = prior.precision(theta)
    return np.minimum(precision, linear.firmest), ~prior.free & (precision < linear.firmest)


def cholesky(information: FloatArray, precision: FloatArray | float = 0.0) -> FloatArray:
    """The lower Cholesky factor (p, p) of A + P.

    What elimination has rounded may be indefinite; the diagonal then grows, in proportion, until it is not. That
    of a matrix with rows and columns scaled is the same factor with its rows scaled: no scaling makes it better.

    Raises:
        LinAlgError: the matrix (p, p) has values that are not finite.
    """
    diagonal = information.diagonal() + precision
    positive = diagonal > 0
    ridge = RIDGE
    while np.isfinite(ridge):
        matrix = information.copy()
        matrix.flat[:: len(matrix) + 1] = np.where(positive, (1 + ridge) * diagonal, ridge)
        # The transpose, in Fortran's order, is not copied. A tenth of the time of cho_factor.
        factor, failed = dpotrf(matrix.T, lower=True, overwrite_a=True)
        if not failed:
            return np.asarray(factor)
        ridge *= 100
    raise np.linalg.LinAlgError("the information has values that are not finite")


def solved(information: FloatArray, right: FloatArray, precision: FloatArray | float = 0.0) -> FloatArray:
    """The solution (p, k) of a positive definite system A + P, (p, p)."""
    return np.asarray(dpotrs(cholesky(information, precision), right, lower=True)[0])


def conditional(linear: GaussianLikelihood, prior: Prior, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean (p,) and covariance (p, p) of x for given hyperparameters."""
    precision = held(linear, prior, theta)[0]
    found = _minimum(linear, prior, precision)
    mean, variance = np.zeros(len(precision)), np.zeros_like(precision)
    mean[found.loose] = found.mean
    np.divide(1.0, precision, out=variance, where=~found.loose)
    root, _ = dtrtri(found.factor, lower=True)
    covariance = np.diag(variance)
    covariance[np.ix_(found.loose, found.loose)] = root.T @ root
    return mean, covariance


def curvature(linear: GaussianLikelihood, prior: Prior, theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """−2 ln p up to a constant, its gradient (h,) and Hessian (h, h).

    With M and m in units of the prior's deviations, D the derivatives of ln v, w = M_ii + m² and W = M∘(M + 2 m mᵀ),
    the gradient is Dᵀ(1 − w), and the Hessian Dᵀ (diag w − W) D and what the change of D itself makes of the gradient,
    which is differenced.
    """
    value, derivatives = _curved(linear, prior, theta)
    return value, *derivatives()


def _curved(
    linear: GaussianLikelihood, prior: Prior, theta: FloatArray
) -> tuple[float, Callable[[], tuple[FloatArray, FloatArray]]]:
    """−2 ln p up to a constant, and what finds its gradient (h,) and Hessian (h, h), see `curvature`."""
    precision, moved = held(linear, prior, theta)
    found = _minimum(linear, prior, precision)
    value = found.value + float(prior.penalty(theta)[0])
    return value, lambda: _derivatives(prior, theta, precision, moved, found)


def _derivatives(
    prior: Prior, theta: FloatArray, precision: FloatArray, moved: BoolArray, found: "_Minimum"
) -> tuple[FloatArray, FloatArray]:
    """The gradient (h,) and the Hessian (h, h), see `curvature`, of a minimum for the prior's precision (p,)."""
    own = moved[found.loose]
    root = np.where(own, np.sqrt(precision[found.loose]), 0.0)
    inverse, _ = dpotri(found.factor, lower=True)  # its lower triangle, as of what is made of it
    m, M = root * found.mean, inverse * np.outer(root, root)
    w = (M.diagonal() + m * m)[own]
    D = prior.derivatives(theta)[moved]
    placed = np.zeros((len(own), len(theta)), order="F")
    placed[own] = D
    W = np.outer(2 * m, m)
    W += M
    W *= M
    hessian = D.T @ (w[:, None] * D) - placed.T @ dsymm(1.0, W, placed, lower=True)
    # The last row is θ itself.
    _, slopes = prior.penalty(theta + np.vstack([DIFFERENCE * np.eye(len(theta)), np.zeros(len(theta))]))
    of_unknowns = (1 - w) @ D
    gradient = of_unknowns + slopes[-1]
    for index in range(len(theta)):
        changed = of_unknowns
        if prior.bends(index):
            away = theta.copy()
            away[index] += DIFFERENCE
            changed = (1 - w) @ prior.derivatives(away)[moved]
        hessian[index] += (changed + slopes[index] - gradient) / DIFFERENCE
    return gradient, (hessian + hessian.T) / 2


@dataclass(frozen=True, eq=False)
class _Minimum:
    """Of −2 ln p by x: its value but for the hyperparameters' own, and the unknowns (k,) that a prior does not fix.

    determinants: the first two terms; loose (p,): which unknowns they are; mean (k,): the posterior's; factor (k, k):
    see `cholesky`.
    """

    value: float
    determinants: float
    loose: BoolArray
    mean: FloatArray
    factor: FloatArray


def _minimum(linear: GaussianLikelihood, prior: Prior, precision: FloatArray) -> _Minimum:
    """For the prior's precision (p,), which may be the firmest."""
    loose = precision < linear.firmest
    if not loose.any():  # LAPACK takes no empty matrix
        loose = ~loose
    rest, value = linear.among(loose)
    own = precision[loose]
    factor = cholesky(rest.information, own)
    u = rest.rhs - own * rest.x
    change = dpotrs(factor, u, lower=True)[0]
    determinants = float(2 * np.log(factor.diagonal()).sum() - np.log(own[~prior.free[loose]]).sum())
    return _Minimum(
        float(determinants + value + own @ rest.squares - u @ change), determinants, loose, rest.x + change, factor
    )
