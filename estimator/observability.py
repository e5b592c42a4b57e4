"""Which directions of the centre of mass a covariance tells, and which it does not."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

UNOBSERVABLE = 0.25  # standard deviation over the features' radius, above which a direction is not observable


@dataclass(frozen=True, eq=False)
class PrincipalAxes:
    """Principal axes of a covariance: standard deviations (3,) in m, ascending, and directions (3, 3), a unit vector a
    row.
    """

    deviations: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, covariance: FloatArray) -> Self:
        """The principal axes of a covariance (3, 3) in m²."""
        values, vectors = np.linalg.eigh(covariance)
        return cls(np.sqrt(np.maximum(values, 0.0)), vectors.T)


@dataclass(frozen=True, eq=False)
class Observability:
    """The observability of the centre of mass.

    body: covariance in the axes of the cluster with an attitude in the most frames; cluster: its index; inertial: the
    mean over all times of the path's covariance in C; threshold: standard deviation in m above which a direction is not
    observable.
    """

    body: PrincipalAxes
    inertial: PrincipalAxes
    cluster: int
    threshold: float

    @property
    def observable(self) -> BoolArray:
        """Which of the directions in body axes are observable, (3,)."""
        return np.asarray(self.body.deviations <= self.threshold)

    @property
    def condition_number(self) -> float:
        """Greatest over least variance in body axes; infinite if the least is zero."""
        least, _, greatest = self.body.deviations
        return float((greatest / least) ** 2) if least > 0 else np.inf
