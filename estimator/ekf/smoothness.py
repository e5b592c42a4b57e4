"""The hyperparameters of a smooth path in `ekf`: those of greatest likelihood, and what their uncertainty adds."""

from dataclasses import dataclass

import numpy as np

from baryscope.estimator.ekf.linearised import INERTIA
from baryscope.estimator.ekf.solution import Parameters, Prior
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, conditional, cost, maximise
from baryscope.estimator.hyperparameters.integration import posterior
from baryscope.estimator.paths.prior import Prior as PathPrior
from baryscope.estimator.tracks import FloatArray


@dataclass(frozen=True, eq=False)
class Smoothness:
    """What the tracks tell of a smooth path, with the other parameters eliminated.

    linear: the problem in the path's unknowns x (s,), in SI units; prior: of them, with hyperparameters; by_path
    (q, s): what a change of x changes of all parameters; variance: of an observation of weight 1.
    """

    linear: GaussianLikelihood
    prior: PathPrior
    by_path: FloatArray
    variance: float

    @classmethod
    def of(
        cls, parameters: Parameters, prior: Prior, of_path: PathPrior, x: FloatArray, variance: float
    ) -> "Smoothness":
        """The smoothness of a path for parameters which are the mean for some hyperparameters.

        prior: of all parameters, in the units of the weights; of_path: that of the path's unknowns, in m²; x (s,) in m.
        """
        path = np.zeros(len(prior.mean), dtype=bool)
        path[INERTIA : INERTIA + len(x)] = True
        kept = ~path
        kept[path] = of_path.free
        weak = np.where(np.outer(kept, kept), prior.information, 0.0)
        whole = parameters.information + weak
        pull = weak @ (prior.mean - parameters.theta) - parameters.gradient
        regression = -symmetric_pseudo_inverse(whole[np.ix_(~path, ~path)]) @ whole[np.ix_(~path, path)]
        information = whole[np.ix_(path, path)] + whole[np.ix_(path, ~path)] @ regression
        values, axes = np.linalg.eigh((information + information.T) / 2)
        information = (axes * np.maximum(values, 0.0)) @ axes.T  # without the rounding of the elimination
        by_path = np.zeros((len(path), len(x)))
        by_path[path], by_path[~path] = np.eye(len(x)), regression
        rhs = (pull[path] + regression.T @ pull[~path]) / variance
        return cls(GaussianLikelihood(information / variance, rhs, x), of_path, by_path, variance)

    def likeliest(self, hyperparameters: FloatArray) -> FloatArray:
        """The hyperparameters (h,), logarithms, of greatest likelihood: from given ones, or from scans."""
        found = [maximise(self.linear, self.prior, start) for start in (hyperparameters, None)]
        return min(found, key=lambda theta: cost(self.linear, self.prior, theta))

    def added(self, hyperparameters: FloatArray) -> FloatArray:
        """The covariance (q, q) that the uncertainty about hyperparameters (h,) adds, in the units of the weights."""
        own = conditional(self.linear, self.prior, hyperparameters)[1]
        grown = posterior(self.linear, self.prior, hyperparameters).about_likeliest - own
        return np.asarray(self.by_path @ (grown / self.variance) @ self.by_path.T)
