"""What the uncertainty of a smooth path's hyperparameters adds to the covariance of the parameters of `ekf`."""

import numpy as np

from baryscope.estimator.adjustment.evidence import Linear, conditional, posterior
from baryscope.estimator.dynamics.prior import Prior as PathPrior
from baryscope.estimator.ekf.linearised import INERTIA
from baryscope.estimator.ekf.solution import Parameters, Prior
from baryscope.estimator.geometry.symmetric import symmetric_pseudo_inverse
from baryscope.estimator.tracks import FloatArray


def uncertain_smoothness(
    parameters: Parameters,
    prior: Prior,
    of_path: PathPrior,
    hyperparameters: FloatArray,
    x: FloatArray,
    variance: float,
) -> FloatArray:
    """The covariance (q, q) to add to that of the parameters, in the units of the weights.

    The other parameters are eliminated, so that the posterior of the path's unknowns follows for any hyperparameters.
    What these change of the others follows by regression.

    Args:
        parameters: with the prior's mean for given hyperparameters (h,).
        prior: of all parameters, in the units of the weights.
        of_path: that of the path's unknowns, in m².
        hyperparameters: (h,), logarithms.
        x: (s,), the path's unknowns, m.
        variance: of an observation of weight 1.
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
    linear = Linear(information / variance, (pull[path] + regression.T @ pull[~path]) / variance, x)
    own = conditional(linear, of_path, hyperparameters)[1]
    added = (posterior(linear, of_path, hyperparameters).covariance - own) / variance
    by_path = np.zeros((len(path), len(x)))
    by_path[path], by_path[~path] = np.eye(len(x)), regression
    return np.asarray(by_path @ added @ by_path.T)
