"""The prior of unknowns, by their variances."""

import warnings
from dataclasses import replace

import numpy as np
from scipy.stats import gamma

from baryscope.estimator.paths.prior import Hyperparameter, Prior


def test_an_unknown_of_no_variance_is_held_without_a_warning():
    """As the slack of a burn in tracks of a moment: there was a division by zero in a logarithm."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        prior = Prior.known(np.array([4.0, 0.0]))
        precision = prior.precision(np.zeros(0))
    assert precision[0] == 0.25
    assert np.isfinite(precision[1])
    assert precision[1] > 1e100
    assert not prior.free.any()


def test_what_is_not_typical_is_improbable_exponentially_or_by_a_rate_that_is_not_exact():
    """A tolerant prior is e^(−λ r) over a rate λ of mean 1 and deviation ½, here by quadrature: exponential near what
    is typical, a power far beyond, where its derivative by ln r is at most that.
    """
    exact = Prior(np.zeros(1), np.ones((1, 2)), (Hyperparameter("noise", typical=2e-4), Hyperparameter("other")))
    tolerant = replace(exact, tolerant=True)
    ratio = np.array([0.01, 0.3, 1.0, 10.0, 1000.0])
    theta = np.column_stack([2 * np.log(2e-4 * ratio), np.full(len(ratio), 7.0)])
    np.testing.assert_allclose(exact.penalty(theta)[0], 2 * ratio)
    found, gradient = tolerant.penalty(theta)
    expected = [gamma.expect(lambda rate, r=r: np.exp(-rate * r), args=(4,), scale=0.25) for r in ratio]
    np.testing.assert_allclose(found, -2 * np.log(expected), rtol=1e-4)
    assert gradient[:, 0].max() < 4.0
    step = np.array([1e-5, 0.0])
    for prior in (exact, tolerant):
        slope = (prior.penalty(theta + step)[0] - prior.penalty(theta - step)[0]) / 2e-5
        np.testing.assert_allclose(prior.penalty(theta)[1], np.column_stack([slope, np.zeros(len(ratio))]), rtol=1e-6)
