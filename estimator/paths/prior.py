"""Gaussian priors of a path's unknowns, whose variances depend on a few hyperparameters."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.geometry.indices import Index, as_slice

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MOST = 600.0  # logarithm of a precision, which does not overflow in products with lengths
TAIL = 4.0  # power of a tolerant prior
MOST_SCATTER = 6.0  # of the logarithm of a variance


@dataclass(frozen=True)
class Hyperparameter:
    """A parameter of a prior, by its natural logarithm: name, and bounds of the logarithm.

    Bounds of None follow from the observations: from a variance without effect to one without a limit. optional: there
    may be nothing of it at all, so that its range goes on below, without an effect. typical: its root is not only
    log-uniform, but exponentially improbable beyond this (Simpson et al. 2017, Statistical Science 32). by_root: its
    root is uniform instead (Gelman 2006, Bayesian Analysis 1, § 3.2), so that none of it is no likelier than any other.
    vanishing: there is nothing of it as likely as not, whatever its range.
    """

    name: str
    lower: float | None = None
    upper: float | None = None
    optional: bool = False
    typical: float | None = None
    by_root: bool = False
    vanishing: bool = False


@dataclass(frozen=True)
class Trend:
    """A law of variances that is not log-linear.

    law: of the numbers (k,) of k unknowns and a parameters, (a,): the logarithms of the variances (k,) and what finds
    their derivatives (a, k); parameters: each the index of a hyperparameter, or the value of one that is fixed.
    """

    law: Callable[[FloatArray, FloatArray], tuple[FloatArray, Callable[[], FloatArray]]]
    parameters: tuple[int | float, ...]

    def at(self, theta: FloatArray) -> tuple[float, ...]:
        """The values (a,) of the parameters for hyperparameters (h,)."""
        return tuple(float(theta[one]) if isinstance(one, int) else one for one in self.parameters)

    @property
    def free(self) -> tuple[tuple[int, int], ...]:
        """Which parameter is which hyperparameter."""
        return tuple((k, one) for k, one in enumerate(self.parameters) if isinstance(one, int))

    def moved(self, by: int) -> "Trend":
        """The trend where there are `by` more hyperparameters before."""
        return replace(self, parameters=tuple(one + by if isinstance(one, int) else one for one in self.parameters))

    def fixed(self, index: int, value: float) -> "Trend":
        """The trend where a hyperparameter has this value, and those after it an index that is less by one."""

        def changed(one: int | float) -> int | float:
            if not isinstance(one, int) or one < index:
                return one
            return value if one == index else one - 1

        return replace(self, parameters=tuple(map(changed, self.parameters)))


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another explanation than a prior, before the observations as likely: other variances of some unknowns.

    rows (k,): their indices; offset (k,): the logarithms of these variances.
    """

    rows: IntArray
    offset: FloatArray

    def of(self, kept: IntArray) -> "Alternative":
        """The same where only the unknowns of these indices are left, (n,) ascending, its own among them."""
        return replace(self, rows=np.searchsorted(kept, self.rows))

    def moved(self, by: int) -> "Alternative":
        """The same where there are `by` more unknowns before."""
        return replace(self, rows=self.rows + by)


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent unknowns x (p,) with mean zero and variances exp(offset + slopes θ), θ (h,) the hyperparameters.

    offset (p,): infinite for an unknown without a prior; slopes (p, h). trend: what comes to the logarithms of the
    variances of the unknowns that have a number, order (p,), other than 0. scatter (p,): how far these logarithms may
    lie above that law from an unknown on that the observations do not tell; other than zero only for the three
    coordinates of one coefficient after the other, for which it is the same. tolerant: what is beyond the typical is
    improbable by a rate that is known to about its half, that is, far beyond by a power (Lomax 1954, J. Am. Stat.
    Assoc. 49), not exponentially.
    alternatives: each to the prior as it is, of unknowns that have no hyperparameter.
    """

    offset: FloatArray
    slopes: FloatArray
    hyperparameters: tuple[Hyperparameter, ...] = ()
    scatter: FloatArray | float = 0.0
    trend: Trend | None = None
    order: FloatArray | float = 0.0
    tolerant: bool = False
    alternatives: tuple[Alternative, ...] = ()
    _laws: dict[tuple[float, ...], tuple[FloatArray, Callable[[], FloatArray]]] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def none(cls, size: int) -> "Prior":
        """No prior on `size` unknowns."""
        return cls(np.full(size, np.inf), np.zeros((size, 0)))

    @classmethod
    def known(cls, variance: FloatArray) -> "Prior":
        """A prior of given variances (p,): one of 0 holds its unknown at 0."""
        with np.errstate(divide="ignore"):
            return cls(np.log(variance), np.zeros((len(variance), 0)))

    @cached_property
    def free(self) -> BoolArray:
        """Which unknowns have no prior, (p,)."""
        return np.isposinf(self.offset)

    @cached_property
    def uses(self) -> BoolArray:
        """Which variances depend on which hyperparameters, (p, h)."""
        found = np.asarray(self.slopes != 0)
        for _, index in () if self.trend is None else self.trend.free:
            found[self._trending, index] = True
        return found

    @cached_property
    def _order(self) -> FloatArray:
        return np.broadcast_to(self.order, self.offset.shape)

    @cached_property
    def _trending(self) -> BoolArray:
        return np.asarray(self._order != 0)

    @cached_property
    def _rows(self) -> Index:
        """Where the unknowns that have a number are."""
        return as_slice(np.flatnonzero(self._trending))

    @cached_property
    def _numbers(self) -> tuple[FloatArray, IntArray]:
        """The different numbers (n,) of the unknowns that have one, and each one's place among them."""
        numbers, places = np.unique(self._order[self._trending], return_inverse=True)
        return numbers, places.ravel()

    def precision(self, theta: FloatArray) -> FloatArray:
        """The inverse variances (p,), zero without a prior, for hyperparameters θ (h,)."""
        logarithm = self.offset + self.slopes @ theta
        if self.trend is not None:
            logarithm[self._rows] += self._law(self.trend, theta)[0]
        return np.asarray(np.exp(np.minimum(-logarithm, MOST)))

    def derivatives(self, theta: FloatArray) -> FloatArray:
        """The derivatives (p, h) of the variances' logarithms by the hyperparameters θ (h,)."""
        if self.trend is None:
            return self.slopes
        found, own = self.slopes.copy(), self._law(self.trend, theta)[1]().take(self._numbers[1], axis=1)
        for parameter, index in self.trend.free:
            found[self._rows, index] += own[parameter]
        return found

    def bends(self, index: int) -> bool:
        """Whether the derivatives depend on a hyperparameter, by its index: the law is not linear in it."""
        return self.trend is not None and any(one == index for _, one in self.trend.free)

    def _law(self, trend: Trend, theta: FloatArray) -> tuple[FloatArray, Callable[[], FloatArray]]:
        """What the trend adds to the logarithms of the variances (k,) that have one, and what finds the derivatives
        (a, n) of the n different ones.

        The last one is kept, as a search asks for the derivatives, too, and changes other hyperparameters.
        """
        at = trend.at(theta)
        if at not in self._laws:
            numbers, places = self._numbers
            self._laws.clear()
            logarithm, derivatives = trend.law(numbers, np.array(at))
            self._laws[at] = logarithm.take(places), derivatives
        return self._laws[at]

    def scattered(self, untold: FloatArray) -> "tuple[Prior, FloatArray]":
        """The prior with its scatter, of unknowns along other axes; and these (p, p), in columns.

        untold (p, p): the posterior covariance in units of the prior's deviations, whose share along an axis the
        observations do not tell. With it the law is one of the logarithm of each coefficient's covariance (3, 3), so
        that it does not depend on the axes of the path's coordinates; a coefficient's new axes are its principal ones.
        """
        scatter = np.broadcast_to(self.scatter, self.offset.shape)
        each = np.flatnonzero(scatter).reshape(-1, 3)
        rows, columns = each[:, :, None], each[:, None, :]
        above, turned = np.linalg.eigh((scatter[rows] * untold[rows, columns]).cumsum(axis=0))
        offset, axes = self.offset.copy(), np.eye(len(scatter))
        offset[each] += np.clip(above, 0.0, MOST_SCATTER)
        axes[rows, columns] = turned
        return replace(self, offset=offset), axes

    def penalty(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """−2 ln p (...) of the hyperparameters θ (..., h) themselves, up to a constant, and its gradient (..., h)."""
        if not self._rates.any():
            return -(theta @ self._by_root), np.broadcast_to(-self._by_root, theta.shape)
        each = self._rates * np.exp(np.where(self._rates > 0, theta, 0.0) / 2)
        cost, slope = (TAIL * np.log1p(each / TAIL), each / (1 + each / TAIL)) if self.tolerant else (each, each)
        return 2 * cost.sum(axis=-1) - theta @ self._by_root, slope - self._by_root

    @cached_property
    def _rates(self) -> FloatArray:
        """Of the exponential priors of the roots (h,), or their means, 0 without one."""
        return np.array([0.0 if one.typical is None else 1 / one.typical for one in self.hyperparameters])

    @cached_property
    def _by_root(self) -> FloatArray:
        return np.array([float(one.by_root) for one in self.hyperparameters])

    def joined(self, other: "Prior") -> "Prior":
        """The prior of the unknowns of both, with the hyperparameters of both; one of the two may have a trend."""
        assert self.trend is None or other.trend is None  # noqa: S101  a path has one smooth part
        scatters = [np.broadcast_to(one.scatter, one.offset.shape) for one in (self, other)]
        return Prior(
            np.concatenate([self.offset, other.offset]),
            block_diag(self.slopes, other.slopes),
            self.hyperparameters + other.hyperparameters,
            np.concatenate(scatters),
            other.trend.moved(len(self.hyperparameters)) if other.trend is not None else self.trend,
            np.concatenate([self._order, other._order]),
            alternatives=self.alternatives + tuple(one.moved(len(self.offset)) for one in other.alternatives),
        )

    def instead(self, other: Alternative) -> "Prior":
        """The prior by the other explanation, without an alternative."""
        offset = self.offset.copy()
        offset[other.rows] = other.offset
        return replace(self, offset=offset, alternatives=())

    def of(self, kept: IntArray) -> "Prior":
        """The prior of some of the unknowns, by their indices (k,)."""
        return replace(
            self,
            offset=self.offset[kept],
            slopes=self.slopes[kept],
            scatter=np.broadcast_to(self.scatter, self.offset.shape)[kept],
            order=self._order[kept],
            alternatives=tuple(one.of(kept) for one in self.alternatives if np.isin(one.rows, kept).all()),
        )

    def index(self, name: str) -> int | None:
        """The index of the hyperparameter of that name, None if there is none."""
        names = [one.name for one in self.hyperparameters]
        return names.index(name) if name in names else None

    def at(self, theta: FloatArray) -> "Prior":
        """The prior with all hyperparameters fixed, θ (h,)."""
        return self.holding({one.name: float(value) for one, value in zip(self.hyperparameters, theta, strict=True)})

    def holding(self, values: Mapping[str, float]) -> "Prior":
        """The prior with the logarithms of some hyperparameters fixed, by their names, of which it may have not all."""
        found = self
        for name, value in values.items():
            found = found.fixed(name, value)
        return found

    def fixed(self, name: str, value: float) -> "Prior":
        """The prior with the logarithm of one hyperparameter fixed; unchanged if there is none of that name."""
        index = self.index(name)
        if index is None:
            return self
        with np.errstate(invalid="ignore"):
            offset = np.where(self.free, np.inf, self.offset + self.slopes[:, index] * value)
        rest = self.hyperparameters[:index] + self.hyperparameters[index + 1 :]
        trend = None if self.trend is None else self.trend.fixed(index, value)
        if trend is not None and not trend.free:
            offset[self._rows] += self._law(trend, np.zeros(0))[0]
            trend = None
        slopes = np.delete(self.slopes, index, axis=1)
        return replace(self, offset=offset, slopes=slopes, hyperparameters=rest, trend=trend)
