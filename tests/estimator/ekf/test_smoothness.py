"""What uncertain hyperparameters add, with the other parameters eliminated, against the problem with all of them."""

import numpy as np
import pytest

from baryscope.estimator.ekf.smoothness import Smoothness
from baryscope.estimator.ekf.solution import Parameters, Prior
from baryscope.estimator.hyperparameters.evidence import GaussianLikelihood, conditional, cost, maximise
from baryscope.estimator.hyperparameters.integration import posterior
from baryscope.estimator.paths.path import SmoothPath
from baryscope.estimator.paths.prior import Prior as PathPrior

BEFORE, AFTER = 5, 9  # parameters before and after the path's


@pytest.fixture(scope="module")
def path():
    return SmoothPath(4, 0.0, 10.0).prior


@pytest.mark.parametrize("variance", [1.0, 1e-4])
def test_elimination_changes_nothing(path, variance):
    """A random problem in 5 + 15 + 9 parameters: `posterior` of all of them together is the oracle."""
    rng, s = np.random.default_rng(2), len(path.offset)
    q = BEFORE + s + AFTER
    x = rng.normal(size=s) * np.repeat(0.3 ** np.arange(s // 3), 3)
    others = np.where(np.isin(np.arange(q), np.arange(BEFORE, BEFORE + s)), 0.0, 0.5)
    root = rng.normal(size=(60, q))
    information = root.T @ root
    before, after = (PathPrior.known(np.full(count, 2.0)) for count in (BEFORE, AFTER))
    everything = before.joined(path).joined(after)
    at = np.concatenate([rng.normal(size=BEFORE), x, rng.normal(size=AFTER)])
    linear = GaussianLikelihood(information, information @ rng.normal(size=q), at)
    theta = maximise(linear, everything)
    mean, covariance = conditional(linear, everything, theta)
    expected = posterior(linear, everything, theta).about_likeliest - covariance
    gradient = information @ (mean - at) - linear.rhs
    parameters = Parameters(mean, covariance / variance, variance * information, variance * gradient, 0.0, 0.0)
    prior = Prior(np.zeros(q), variance * np.diag(others))
    smoothness = Smoothness.of(parameters, prior, path, mean[BEFORE : BEFORE + s], variance)
    found = variance * smoothness.added(theta)
    reached = smoothness.likeliest(theta + 1.0)
    # The search ends where slopes are below 1e-2: along a flat direction of a deviation of 10, 1e-2 above the minimum.
    assert cost(linear, everything, reached) <= cost(linear, everything, theta) + 1e-2
    # The positive part is taken of other matrices.
    np.testing.assert_allclose(found, expected, rtol=2e-2, atol=2e-2 * np.abs(expected).max())
