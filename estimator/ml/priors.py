"""The priors of ml's unknowns y = (rotation, x): weak ones for what the tracks do not determine, and those of noise.

A pure spin, or little motion, leaves the inertia, or a direction of the path, undetermined, and the likelihood alone
has no bounded maximum there. Weak Gaussian priors determine these directions. Elsewhere the one of the inertia reduces
a variance σ² by about the share (σ/0.5)², for an element of the inertia of trace 1 with σ much smaller than 0.5. They
are no part of the Cramér–Rao bound. The modes of process and torque noise have the priors of their densities.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from baryscope.estimator.dynamics.inertia import INERTIA_DEVIATION, Excess
from baryscope.estimator.dynamics.rotation import INERTIA, RATE_AND_INERTIA, Rotation
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood
from baryscope.estimator.ml.likelihood import Equations
from baryscope.estimator.paths.path import Path
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.sampled_path import SampledPath
from baryscope.models.attitude import INERTIA_BASIS

FloatArray = NDArray[np.float64]

DENSITY = "torque noise"


@dataclass(frozen=True, eq=False)
class Priors:
    """Priors of y (q,): weak ones with a mean, and independent ones of mean zero with hyperparameters.

    The weak mean of the inertia is a sphere's, with INERTIA_DEVIATION. That of the path is the one of `pivot`, with an
    rms deviation of the target's distance. information (q, q) and mean (q,) of the weak ones.
    """

    information: FloatArray
    mean: FloatArray
    own: Prior

    @classmethod
    def of(
        cls, rotation: Rotation, path: Path, sampled: SampledPath, x0: FloatArray, density: float | None
    ) -> "Priors":
        """The priors of rotation and path with the weak mean x0 (p,); density of the torque noise, None if unknown."""
        distance = np.linalg.norm(sampled.position(x0), axis=1).max()
        inertia = np.eye(RATE_AND_INERTIA - 3) / INERTIA_DEVIATION**2
        of_path = sampled.mean_square() / distance**2
        modes = rotation.size - RATE_AND_INERTIA
        own = Prior.none(RATE_AND_INERTIA)
        if modes:
            torque = Prior(np.zeros(modes), np.ones((modes, 1)), (Hyperparameter(DENSITY, optional=True),))
            own = own.joined(torque if density is None else torque.fixed(DENSITY, float(np.log(density))))
        return cls(
            block_diag(np.zeros((3, 3)), inertia, np.zeros((modes, modes)), of_path),
            np.concatenate([np.zeros(rotation.size), x0]),
            own.joined(path.prior),
        )

    @staticmethod
    def values(rotation: Rotation, x: FloatArray) -> FloatArray:
        """The unknowns (q,) as the priors see them; the rate has none and is given as zero."""
        torque = np.zeros(0) if rotation.torque is None else rotation.torque.coefficients.ravel()
        return np.concatenate([np.zeros(3), np.tensordot(INERTIA_BASIS, rotation.inertia), torque, x])

    def linear(self, found: Equations, values: FloatArray, variance: float) -> GaussianLikelihood:
        """The linear problem at unknowns (q,), with the weak priors; variance: of an observation of weight 1."""
        pull = self.information @ (values - self.mean)
        return GaussianLikelihood(found.matrix / variance + self.information, found.rhs / variance - pull, values)

    def bounded(self, linear: GaussianLikelihood) -> GaussianLikelihood:
        """The linear problem with the bound of the inertia, for steps: it is no part of a covariance."""
        excess, information, rhs = self._excess(linear.x), linear.information.copy(), linear.rhs.copy()
        information[INERTIA, INERTIA] += excess.information
        rhs[INERTIA] -= excess.pull
        return GaussianLikelihood(information, rhs, linear.x)

    def cost(self, values: FloatArray, precision: FloatArray) -> float:
        """−2 ln p of unknowns (q,), up to a constant, for inverse variances (q,) of their own priors."""
        deviation = values - self.mean
        weak = float(deviation @ self.information @ deviation + precision @ (values * values))
        return weak + self._excess(values).cost

    @staticmethod
    def _excess(values: FloatArray) -> Excess:
        return Excess.of(np.eye(3) / 3 + np.tensordot(values[INERTIA], INERTIA_BASIS, 1))
