"""The prior of unknowns, by their variances."""

import warnings

import numpy as np

from baryscope.estimator.paths.prior import Prior


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
