"""Covariances of attitude, rate and inertia in axes that are attached to features.

The axes of the equations are defined by the attitude at the epoch, which has no error in them. The least-squares
rotation of the features relative to them, −κ, depends on the points: κ = (Σ −[a]×²)⁻¹ Σ a × δb, a from the centroid. It
changes rate and inertia, too.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baryscope.estimator.dynamics.rotation import RATE_AND_INERTIA
from baryscope.estimator.geometry.gauge import attached_turn
from baryscope.estimator.geometry.so3 import cross_matrices
from baryscope.estimator.geometry.symmetric import factor_of
from baryscope.estimator.ml.jacobians import Jacobians
from baryscope.estimator.ml.likelihood import Equations
from baryscope.models.attitude import INERTIA_BASIS

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AttachedAxes:
    """Axes attached to features, by their turn κ.

    by_y (3, q): its Jacobian by the unknowns y; own (3, 3): its covariance for known y; y (q, q): the covariance of y.
    """

    by_y: FloatArray
    own: FloatArray
    y: FloatArray

    @classmethod
    def of(cls, found: Equations, y: FloatArray, features: NDArray[np.intp], variance: float = 1.0) -> "AttachedAxes":
        """The axes of features (k,), for a covariance y (q, q), and a variance of an observation of weight 1."""
        by_points, q = attached_turn(found.points[features]), len(y)
        followed = found.by_unknowns.reshape(len(found.points), 3, q)[features].reshape(-1, q)
        own = variance * by_points @ found.covariance_of_points(features) @ by_points.T
        return cls(-by_points @ followed, np.asarray(own), y)

    def covariance(self, of_y: FloatArray, of_kappa: FloatArray) -> FloatArray:
        """The covariance (..., k, k) of what changes by of_y (..., k, q) δy and of_kappa (..., k, 3) κ."""
        # By a factor, so that what hardly varies beside what hardly is known has no variance below zero.
        moved = (of_y + of_kappa @ self.by_y) @ self._factor
        own = of_kappa @ self.own @ np.swapaxes(of_kappa, -1, -2)
        return np.asarray(moved @ np.swapaxes(moved, -1, -2) + own)

    @cached_property
    def _factor(self) -> FloatArray:
        """Of y's covariance, (q, r)."""
        return factor_of(self.y)

    def over_time(self, of_rotation: Jacobians, R: FloatArray, of_kappa: FloatArray) -> FloatArray:
        """The covariances (n, 3, 3) in B of what changes by the rotation's unknowns, by a Jacobian in C, and by κ.

        R (n, 3, 3) R_C_B; of_kappa (n, 3, 3) in B.
        """
        R_B_C, with_kappa = np.swapaxes(R, 1, 2), self.y @ self.by_y.T
        of_kappas = self.by_y @ with_kappa + self.own
        size = of_rotation.function(of_rotation.time[:1]).shape[2]
        crossed = R_B_C @ of_rotation.times(with_kappa[:size]) @ np.swapaxes(of_kappa, 1, 2)
        alone = R_B_C @ of_rotation.covariances(self.y[:size, :size]) @ R
        turned = of_kappa @ of_kappas @ np.swapaxes(of_kappa, 1, 2)
        return np.asarray(alone + crossed + np.swapaxes(crossed, 1, 2) + turned)

    def of_inertia(self, inertia: FloatArray) -> FloatArray:
        """The covariance (5, 5) of the coefficients of INERTIA_BASIS of an inertia (3, 3) of trace 1.

        In axes rotated by κ a tensor J is J − [κ]× J + J [κ]×.
        """
        turned = [inertia @ K - K @ inertia for K in cross_matrices(np.eye(3))]
        by_kappa = np.array([[np.sum(basis * change) for change in turned] for basis in INERTIA_BASIS])
        return self.covariance(np.eye(RATE_AND_INERTIA - 3, len(self.y), 3), by_kappa)

    def of_rate(self, rate: FloatArray) -> FloatArray:
        """The covariance (3, 3) of the rate (3,) at the epoch, (rad/s)²: a vector v is v − κ × v there."""
        return self.covariance(np.eye(3, len(self.y)), cross_matrices(rate[None])[0])
