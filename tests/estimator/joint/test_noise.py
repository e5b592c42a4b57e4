"""The likelihood of functions of time in the noise, against that of the observations' own dense covariance."""

import numpy as np
import pytest

from baryscope.estimator.joint.noise import _Reduced
from baryscope.estimator.joint.variances import KNOWN
from joints import restricted

SPECTRUM, VARIANCES, UNKNOWNS = 0.04, np.array([0.5, 2.0]), 3


def test_functions_of_a_known_variance_are_in_the_noise_as_they_are():
    """The unknowns, and by how much the likelihood of another variance differs, as of dense least squares."""
    rng = np.random.default_rng(4)
    design, functions, known = (rng.normal(size=(40, count)) for count in (UNKNOWNS, 2, 4))
    wanted = rng.normal(size=40)
    matrix = np.concatenate([design, functions, known], axis=1)
    group = np.repeat([-1, 0, KNOWN], [UNKNOWNS, 2, 4])
    reduced = _Reduced(matrix.T @ matrix / SPECTRUM, matrix.T @ wanted / SPECTRUM, group)
    logarithms = []
    for variance in VARIANCES:
        dense = SPECTRUM * np.eye(40) + variance * functions @ functions.T + known @ known.T
        expected = restricted(design, dense, wanted)
        mean, covariance = reduced.posterior(np.array([variance]))
        np.testing.assert_allclose(mean[:UNKNOWNS], expected[0], rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(covariance[:UNKNOWNS, :UNKNOWNS], expected[1], rtol=1e-9, atol=1e-10)
        logarithms.append((reduced.likelihood(np.array([variance]), mean, covariance), expected[2]))
    assert np.diff(logarithms, axis=0)[0, 0] == pytest.approx(np.diff(logarithms, axis=0)[0, 1], rel=1e-8)
