"""Members of a posterior: their moments, and roots of covariances that may be singular."""

import numpy as np
import pytest

from baryscope.estimator.geometry.members import opposite_pairs, root_of


def test_pairs_have_no_mean_and_a_covariance_of_one():
    ways = opposite_pairs(11)
    np.testing.assert_allclose(ways.mean(axis=0), 0.0, atol=1e-15)
    np.testing.assert_allclose(ways.T @ ways / len(ways), np.eye(11), atol=1e-12)


@pytest.mark.parametrize("rank", [1, 4, 7])
def test_a_root_has_an_inverse_whatever_the_units_and_the_rank(rank):
    """Unknowns in metres beside others in nanometres, whose covariance has a null space unless the rank is 7."""
    columns = np.random.default_rng(rank).standard_normal((7, rank)) * np.logspace(0, -9, 7)[:, None]
    covariance = columns @ columns.T
    root, inverse = root_of(covariance)
    size = np.sqrt(np.diag(covariance))
    assert root.shape == inverse.shape == (7, rank)
    np.testing.assert_allclose(root @ root.T / np.outer(size, size), covariance / np.outer(size, size), atol=1e-10)
    np.testing.assert_allclose(inverse.T @ root, np.eye(rank), atol=1e-9)
