"""The parameters of `ekf` where information is lost in rounding, against closed forms."""

import numpy as np
import pytest

from baryscope.estimator.ekf.filter import Forward
from baryscope.estimator.ekf.solution import Prior, parameters_of
from baryscope.models.errors import ComputationError

SUM, VALUE = 1e12, 3.0  # information on x + y, and its value
PRIOR, MEAN = 1e-8, 0.5  # information of the prior of x, and its mean


def of_a_sum(rounding):
    """The quadratic form in (1, x, y) of observations of x + y only."""
    cost = SUM * np.array([[VALUE * VALUE, -VALUE, -VALUE], [-VALUE, 1.0, 1.0], [-VALUE, 1.0, 1.0]])
    return Forward(cost[None], np.full((1, 3, 3), rounding), np.zeros(1))


def test_what_is_lost_in_rounding_is_as_the_prior_says():
    """x is that of the prior, 20 digits beside the information on the sum; y = s − x; and det = I p."""
    found = parameters_of(of_a_sum(1e-16 * SUM), 0, Prior(np.array([MEAN, 0.0]), np.diag([PRIOR, 0.0])))
    np.testing.assert_allclose(found.theta, [MEAN, VALUE - MEAN], rtol=1e-9)
    np.testing.assert_allclose(found.covariance * PRIOR, [[1.0, -1.0], [-1.0, 1.0]], rtol=1e-9)
    assert found.log_determinant == pytest.approx(np.log(SUM * PRIOR), rel=1e-9)
    assert found.squares == pytest.approx(0.0, abs=1e-16 * SUM * VALUE * VALUE * 10)


@pytest.mark.parametrize(
    ("rounding", "information"), [(1e-16 * SUM, 0.0), (1e-3 * SUM, PRIOR)], ids=["no prior", "all lost"]
)
def test_what_nothing_tells_is_refused(rounding, information):
    with pytest.raises(ComputationError, match="diverges"):
        parameters_of(of_a_sum(rounding), 0, Prior(np.array([MEAN, 0.0]), np.diag([information, 0.0])))


def test_a_prior_that_rounding_makes_positive_is_none():
    """One combination of four parameters is observed, and another has a prior: two are not told by anything. Of their
    information of zero rounding often makes a positive one, of a singular matrix in 3 of 100 draws: an internal error.
    """
    refused = 0
    for draw in range(1000):
        seen, known = np.random.default_rng(draw).normal(size=(2, 4))
        cost = np.zeros((1, 5, 5))
        cost[0, 1:, 1:] = SUM * np.outer(seen, seen)
        forward = Forward(cost, np.full((1, 5, 5), 1e-16 * SUM), np.zeros(1))
        try:
            parameters_of(forward, 0, Prior(np.zeros(4), PRIOR * np.outer(known, known)))
        except ComputationError:
            refused += 1
    assert refused > 500
