"""The likelihood of functions of time in the noise, against that of the observations' own dense covariance."""

import numpy as np
import pytest

from baryscope.estimator.joint.noise import KNOWN, LEAST_SHARE, MOST_STEPS, STEP, _Reduced

SPECTRUM, VARIANCES, UNKNOWNS = 0.04, np.array([0.5, 2.0]), 3


def restricted(design, covariance, wanted):
    """The unknowns by generalised least squares, their covariance, and the logarithm of the restricted likelihood."""
    information = design.T @ np.linalg.solve(covariance, design)
    found = np.linalg.solve(information, design.T @ np.linalg.solve(covariance, wanted))
    left = wanted - design @ found
    square = left @ np.linalg.solve(covariance, left)
    logarithm = -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1] + square)
    return found, np.linalg.inv(information), logarithm


@pytest.mark.parametrize("ceiling", [1e3 * VARIANCES[1], 1.2 * VARIANCES[1], 0.1 * VARIANCES[1]])
@pytest.mark.parametrize("size", [1, 5])
@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_over_a_variance_is_that_of_dense_least_squares(seed, size, ceiling):
    """Mean and scatter of the unknowns over the variances of one of two groups, weighted by their likelihoods.

    The covariance has a condition of 2e7 at most, with which rounding makes errors of 4e-9 in the dense solution.
    """
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(40, UNKNOWNS))
    functions = [rng.normal(size=(40, count)) + design[:, :1] for count in (2, size)]
    wanted = rng.normal(size=40)

    def at(variance):
        noise = SPECTRUM * np.eye(40) + VARIANCES[0] * functions[0] @ functions[0].T
        return restricted(design, noise + variance * functions[1] @ functions[1].T, wanted)

    middle, own, at_best = at(VARIANCES[1])
    kept = [(1.0, VARIANCES[1], middle, own)]
    for ratio in (STEP, 1 / STEP):
        for variance in VARIANCES[1] * ratio ** np.arange(1, MOST_STEPS + 1):
            mean, covariance, logarithm = at(variance)
            weight = np.exp(min(logarithm - at_best, 0.0))
            if variance > ceiling or weight < LEAST_SHARE:
                break
            kept.append((weight, variance, mean, covariance))
    weights, variances, means, covariances = map(np.array, zip(*kept, strict=True))
    share = weights / weights.sum()
    away = means - middle
    growth = np.tensordot(share, covariances, 1) + (away.T * share) @ away - own
    values, vectors = np.linalg.eigh(growth)
    expected = (vectors * np.maximum(values, 0.0)) @ vectors.T

    matrix = np.concatenate([design, *functions], axis=1)
    group = np.repeat([-1, 0, 1], [UNKNOWNS, 2, size])
    reduced = _Reduced(matrix.T @ matrix / SPECTRUM, matrix.T @ wanted / SPECTRUM, group)
    found, mean_variance = reduced.over_variance(VARIANCES, 1, ceiling, UNKNOWNS)
    assert mean_variance == pytest.approx(share @ variances, rel=1e-7)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-8 * np.trace(own))


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
