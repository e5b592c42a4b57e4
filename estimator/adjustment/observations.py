"""Observations of features in C, with their weights and precisions."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.geometry.indices import Index, IntArray, as_slice

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations of m features in n frames.

    position (n, m, 3) in C, m, 0 where not used; weight (n, m) >= 0, 0 where not used; precision (n, m, 3, 3) in 1/m²,
    the inverse covariance of an observation of weight 1, or None: then the weight is proportional to the inverse
    variance of each coordinate.
    """

    position: FloatArray
    weight: FloatArray
    precision: FloatArray | None = None

    @property
    def count(self) -> int:
        """The number of observations used."""
        return int(np.count_nonzero(self.weight))

    @cached_property
    def farthest(self) -> float:
        """The greatest distance of a position from the camera, m."""
        return float(np.sqrt(np.einsum("kmi,kmi->km", self.position, self.position).max(initial=0.0)))

    def frames(self, index: Index) -> "Observations":
        """The observations of some frames; a view if these are contiguous."""
        index = as_slice(index)
        precision = None if self.precision is None else self.precision[index]
        return Observations(self.position[index], self.weight[index], precision)

    def features(self, index: IntArray) -> "Observations":
        """The observations of some features; a view if these are contiguous."""
        columns = as_slice(index)
        precision = None if self.precision is None else self.precision[:, columns]
        return Observations(self.position[:, columns], self.weight[:, columns], precision)

    def weighted(self, weight: FloatArray) -> "Observations":
        """The observations with other weights (n, m)."""
        return replace(self, weight=weight)

    def squares(self, residual: FloatArray) -> FloatArray:
        """rᵀ P r (n, m) of residuals r (n, m, 3) in C, m, for weight 1; without precisions rᵀ r in m²."""
        if self.precision is None:
            return np.asarray(np.einsum("kmi,kmi->km", residual, residual))
        return np.asarray(np.einsum("kmi,kmij,kmj->km", residual, self.precision, residual))
