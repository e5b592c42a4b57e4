"""What variances of functions in the noise may be together, against quadrature with the observations' covariance."""

import numpy as np
import pytest

from baryscope.estimator.joint.noise import restricted_likelihood
from baryscope.estimator.joint.variances import KNOWN, UNKNOWN, possible_variances
from joints import restricted

NOISE, ROWS, UNKNOWNS, NODES = 0.04, 24, 2, 81


def equations(design, functions, known, wanted):
    """Normal equations, their right side, and whose coefficient each is."""
    matrix = np.concatenate([design, *functions, known], axis=1)
    sizes = [design.shape[1], *(one.shape[1] for one in functions), known.shape[1]]
    group = np.repeat([UNKNOWN, *range(len(functions)), KNOWN], sizes)
    return matrix.T @ matrix / NOISE, matrix.T @ wanted / NOISE, group


def drawn(seed, sizes, present):
    """Unknowns, two groups of functions that look like the unknowns and each other, known ones, and what is observed,
    with coefficients of the groups of the deviations `present`."""
    rng = np.random.default_rng(seed)
    design, known = rng.normal(size=(ROWS, UNKNOWNS)), 0.3 * rng.normal(size=(ROWS, 2))
    like = rng.normal(size=(ROWS, 1))
    functions = [rng.normal(size=(ROWS, size)) + 2 * design[:, :1] + 2 * like for size in sizes]
    wanted = np.sqrt(NOISE) * rng.normal(size=ROWS) + known @ rng.normal(size=2)
    for one, deviation in zip(functions, present, strict=True):
        wanted = wanted + one @ (deviation * rng.normal(size=one.shape[1]))
    return design, functions, known, wanted


def by_quadrature(design, functions, known, wanted, largest):
    """Mean variances (2,) and the second moment of the unknowns about 0 (p, p), by the trapezoidal rule on a fine
    lattice of both variances and none, each with the dense covariance of the observations.
    """
    sure = NOISE * np.eye(ROWS) + known @ known.T
    axes = []
    for one, most in zip(functions, largest, strict=True):
        least = min(1 / np.linalg.eigvalsh(one.T @ np.linalg.solve(sure, one))[-1], most)
        inner = np.full(NODES, 1.0)
        inner[[0, -1]] = 0.5
        prior = np.concatenate([[0.5], 0.5 * inner / inner.sum()])
        axes.append((np.concatenate([[0.0], np.geomspace(least, most, NODES)]), prior))
    terms, logarithms = [], []
    (others, of_others), part = axes[1], functions[1] @ functions[1].T
    for first, of_first in zip(*axes[0], strict=True):
        noise = sure + first * functions[0] @ functions[0].T + others[:, None, None] * part
        mean, covariance, logarithm = restricted(design, noise, wanted)
        moments = (covariance + mean[:, :, None] * mean[:, None]).reshape(len(others), -1)
        terms.append(np.column_stack([np.full(len(others), first), others, moments]))
        logarithms.append(logarithm + np.log(of_first * of_others))
    terms, logarithms = np.concatenate(terms), np.concatenate(logarithms)
    weight = np.exp(logarithms - logarithms.max())
    found = weight @ terms / weight.sum()
    return found[:2], found[2:].reshape(UNKNOWNS, UNKNOWNS)


@pytest.mark.parametrize(
    ("sizes", "present", "largest"),
    [
        ((2, 3), (0.0, 0.0), (100.0, 100.0)),
        ((2, 3), (1.0, 0.0), (100.0, 100.0)),
        ((1, 6), (0.0, 3.0), (1.0, 1e4)),
        ((5, 1), (1.0, 1.0), (100.0, 1e-3)),
    ],
)
def test_the_moments_over_all_variances_are_those_of_quadrature(sizes, present, largest):
    """The lattice here has steps of 1.3 in a variance at most, and there of 2; what is left out adds a thousandth of
    the noise's covariance. One variance at a time, with the other at its likeliest, gave deviations from 0.94 to 1.54
    times these: what the second group of the third case shows may be of the first in part.
    """
    design, functions, known, wanted = drawn(3, sizes, present)
    possible = possible_variances(*equations(design, functions, known, wanted), np.array(largest))
    variances, moments = by_quadrature(design, functions, known, wanted, largest)
    assert possible.weight.sum() == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(possible.weight @ possible.variances, variances, rtol=0.03)
    scale = np.sqrt(np.diag(moments))
    found = possible.about(np.zeros(UNKNOWNS)) / np.outer(scale, scale)
    np.testing.assert_allclose(found, moments / np.outer(scale, scale), atol=0.02)


def test_what_shows_may_be_of_one_group_or_of_the_other():
    """Two groups have the function that shows, and one with it that the unknown explains, ten times as large in the
    second: whose it is nothing tells, so that the claim is a mean, nearer to that of the second alone. With the
    variances integrated over one at a time, the other at its likeliest, it was 8.3 or 83, of the first or the second
    alone, as one or the other had been found: both are as likely. Nor does it matter which is given first.
    """
    rng = np.random.default_rng(2)
    hidden, shown = rng.normal(size=(2, ROWS, 1))
    wanted = np.sqrt(NOISE) * rng.normal(size=ROWS) + 3 * shown[:, 0]
    groups, none = [np.concatenate([size * hidden, shown], axis=1) for size in (1.0, 10.0)], np.zeros((ROWS, 0))
    claims = []
    for functions in ([groups[0]], [groups[1]], groups, groups[::-1]):
        largest = np.full(len(functions), 1e3)
        possible = possible_variances(*equations(hidden, functions, none, wanted), largest)
        claims.append(np.sqrt(possible.about(np.zeros(1))[0, 0]))
    first, second, both, turned = claims
    assert both == pytest.approx(turned, rel=1e-6)
    assert second > 9 * first
    assert 0.5 * second < both < 0.9 * second  # 0.71 where both are as likely


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_exact_observations_leave_a_covariance_that_is_positive_and_small(scale):
    """Without noise, with functions that the unknowns explain altogether, and others that are sums of these: the
    likelihood is that of rounding in directions which the unknowns explain, where eigenvalues are negative unless what
    is rounding counts as none."""
    rng = np.random.default_rng(4)
    design = rng.normal(size=(60, 3, 4))
    explained = [design @ rng.normal(size=(4, 4)), design]
    functions = [np.concatenate([one, rng.normal(size=(60, 3, 3))], axis=2) for one in explained]
    truth = scale * np.arange(1.0, 5.0)
    fit = restricted_likelihood(design, design @ truth, functions, np.arange(60)).over_variances(10.0 * scale)
    np.testing.assert_allclose(fit.found, truth, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, fit.covariance.T, atol=1e-12 * np.trace(fit.covariance))
    values = np.linalg.eigvalsh(fit.covariance)
    assert values[0] > 0
    assert np.sqrt(values[-1]) < 1e-9 * scale
