"""Linear observations of two free unknowns, and of twelve whose variances a hyperparameter scales."""

import numpy as np

from baryscope.estimator.paths.prior import Hyperparameter, Prior

PRIOR = Prior.none(2).joined(Prior(np.linspace(0, -3, 12), np.ones((12, 1)), (Hyperparameter("scale"),)))


def observed(seed, variance):
    """H (60, 14), the unknowns x (14,), drawn with this scale of their variances, and H x with noise of 1."""
    rng = np.random.default_rng(seed)
    H = rng.normal(size=(60, 14))
    x = np.concatenate([rng.normal(size=2) * 5, np.sqrt(np.exp(PRIOR.offset[2:]) * variance) * rng.normal(size=12)])
    return H, x, H @ x + rng.normal(size=60)
