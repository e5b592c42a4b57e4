"""Gaussian priors of a path's unknowns, whose variances are log-linear in a few hyperparameters."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MOST = 600.0  # logarithm of a precision, which does not overflow in products with lengths
MOST_SCATTER = 6.0  # of the logarithm of a variance


@dataclass(frozen=True)
class Hyperparameter:
    """A parameter of a prior, by its natural logarithm: name, and bounds of the logarithm.

    Bounds of None follow from the observations: from a variance without effect to one without a limit. optional: there
    may be nothing of it at all, so that its range goes on below, without an effect. typical: its root is not only
    log-uniform, but exponentially improbable beyond this (Simpson et al. 2017, Statistical Science 32). by_root: its
    root is uniform instead (Gelman 2006, Bayesian Analysis 1, § 3.2), so that none of it is no likelier than any other.
    """

    name: str
    lower: float | None = None
    upper: float | None = None
    optional: bool = False
    typical: float | None = None
    by_root: bool = False


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent unknowns x (p,) with mean zero and variances exp(offset + slopes θ), θ (h,) the hyperparameters.

    offset (p,): infinite for an unknown without a prior; slopes (p, h). scatter (p,): how far the logarithms of the
    variances may lie above that law from an unknown on that the observations do not tell; other than zero only for the
    three coordinates of one coefficient after the other.
    """

    offset: FloatArray
    slopes: FloatArray
    hyperparameters: tuple[Hyperparameter, ...] = ()
    scatter: FloatArray | float = 0.0

    @classmethod
    def none(cls, size: int) -> "Prior":
        """No prior on `size` unknowns."""
        return cls(np.full(size, np.inf), np.zeros((size, 0)))

    @classmethod
    def known(cls, variance: FloatArray) -> "Prior":
        """A prior of given variances (p,)."""
        return cls(np.log(variance), np.zeros((len(variance), 0)))

    @cached_property
    def free(self) -> BoolArray:
        """Which unknowns have no prior, (p,)."""
        return np.isposinf(self.offset)

    def precision(self, theta: FloatArray) -> FloatArray:
        """The inverse variances (p,), zero without a prior, for hyperparameters θ (h,)."""
        return np.asarray(np.exp(np.minimum(-(self.offset + self.slopes @ theta), MOST)))

    def scattered(self, untold: FloatArray) -> "Prior":
        """The prior with its scatter, for the shares (p,) of the variances that the observations do not tell."""
        if not np.any(self.scatter):
            return self
        above = self.scatter * untold
        own = np.broadcast_to(self.scatter, above.shape) > 0
        above[own] = np.minimum(above[own].reshape(-1, 3).cumsum(axis=0), MOST_SCATTER).ravel()
        return replace(self, offset=self.offset + above)

    def penalty(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """−2 ln p (...) of the hyperparameters θ (..., h) themselves, up to a constant, and its gradient (..., h)."""
        each = self._rates * np.exp(np.where(self._rates > 0, theta, 0.0) / 2)
        return 2 * each.sum(axis=-1) - theta @ self._by_root, each - self._by_root

    @cached_property
    def _rates(self) -> FloatArray:
        """Of the exponential priors of the roots (h,), 0 without one."""
        return np.array([0.0 if one.typical is None else 1 / one.typical for one in self.hyperparameters])

    @cached_property
    def _by_root(self) -> FloatArray:
        return np.array([float(one.by_root) for one in self.hyperparameters])

    def joined(self, other: "Prior") -> "Prior":
        """The prior of the unknowns of both, with the hyperparameters of both."""
        scatters = [np.broadcast_to(one.scatter, one.offset.shape) for one in (self, other)]
        return Prior(
            np.concatenate([self.offset, other.offset]),
            block_diag(self.slopes, other.slopes),
            self.hyperparameters + other.hyperparameters,
            np.concatenate(scatters),
        )

    def index(self, name: str) -> int | None:
        """The index of the hyperparameter of that name, None if there is none."""
        names = [one.name for one in self.hyperparameters]
        return names.index(name) if name in names else None

    def fixed(self, name: str, value: float) -> "Prior":
        """The prior with the logarithm of one hyperparameter fixed; unchanged if there is none of that name."""
        index = self.index(name)
        if index is None:
            return self
        with np.errstate(invalid="ignore"):
            offset = np.where(self.free, np.inf, self.offset + self.slopes[:, index] * value)
        rest = self.hyperparameters[:index] + self.hyperparameters[index + 1 :]
        return replace(self, offset=offset, slopes=np.delete(self.slopes, index, axis=1), hyperparameters=rest)
