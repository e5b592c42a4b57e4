"""Hyperparameters of maximum marginal likelihood: against the density of the observations, and in repeated draws."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from baryscope.estimator.hyperparameters.evidence import (
    GaussianLikelihood,
    complexity,
    cost,
    curvature,
    held,
    improved,
    maximise,
    ranges,
)
from baryscope.estimator.paths.path import SmoothPath
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from scaled_unknowns import PRIOR, observed


def test_the_objective_is_the_density_of_the_observations():
    """Of 60 observations given the free unknowns' wide prior; differences between two values of θ."""
    H, _, y = observed(0, 0.4)
    at = np.full(14, 0.2)
    linear = GaussianLikelihood(H.T @ H, H.T @ (y - H @ at), at)
    wide, found, expected = 1e5, [], []
    for theta in (-2.0, 0.5):
        variances = np.concatenate([np.full(2, wide), np.exp(PRIOR.offset[2:] + theta)])
        density = multivariate_normal(np.zeros(60), np.eye(60) + (H * variances) @ H.T)
        expected.append(-2 * density.logpdf(y))
        found.append(curvature(linear, PRIOR, np.array([theta]))[0])
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], rel=1e-3)


@pytest.mark.parametrize("theta", [(-40.0, 0.5), (-2.0, -45.0), (-60.0, -60.0)])
def test_unknowns_that_the_prior_fixes_are_zero(theta):
    """From a place where they are not: the density is that of observations without them, up to one in 10⁶."""
    two = Prior.none(2).joined(Prior(np.linspace(0, -3, 6), np.ones((6, 1)), (Hyperparameter("first"),)))
    two = two.joined(Prior(np.linspace(0, -3, 6), np.ones((6, 1)), (Hyperparameter("second"),)))
    H, x, y = observed(2, 1.0)
    linear = GaussianLikelihood(H.T @ H, H.T @ (y - H @ x), x)
    wide, found, expected = 1e5, [], []
    for at in (np.zeros(2), np.array(theta)):
        variances = np.concatenate([np.full(2, wide), np.exp(two.offset[2:] + two.slopes[2:] @ at)])
        expected.append(-2 * multivariate_normal(np.zeros(60), np.eye(60) + (H * variances) @ H.T).logpdf(y))
        value, gradient, _ = curvature(linear, two, at)
        found.append(value)
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], rel=1e-3)
    np.testing.assert_array_equal(gradient[np.less(theta, -30)], 0.0)


def test_the_complexity_of_unknowns_that_the_prior_fixes_away_from_zero():
    """All that departs from the prior counts, and nothing of the observations but their information, however far they
    are from what x would make them.
    """
    H, x, y = observed(3, 1.0)
    y = y + 1e9
    prior = Prior.none(2).joined(Prior.known(np.concatenate([np.exp(np.linspace(0, -3, 6)), np.full(6, 1e-30)])))
    linear = GaussianLikelihood(H.T @ H, H.T @ (y - H @ x), x)
    precision = held(linear, prior, np.zeros(0))[0]
    expected = np.linalg.slogdet(H.T @ H + np.diag(precision))[1] - np.log(precision[2:]).sum() + precision @ x**2
    assert complexity(linear, prior) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("law", ["log-linear", "smooth"])
def test_gradient_and_hessian_are_those_of_the_density(law):
    """Of a prior with one scale, and of a smooth path's, whose law is not linear, with noise that is hardly great."""
    prior, theta = PRIOR, np.array([0.3])
    if law == "smooth":
        noise = Prior(np.zeros(3), np.ones((3, 1)), (Hyperparameter("noise", typical=0.5),))
        prior, theta = SmoothPath(3, 0.0, 1.0).prior.joined(noise), np.array([0.4, -0.3, 0.8, -0.6])
    size = len(prior.offset)
    rng = np.random.default_rng(1)
    H, y = rng.standard_normal((60, size)), rng.standard_normal(60)
    linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(size))
    _, gradient, hessian = curvature(linear, prior, theta)
    for k, away in enumerate(1e-5 * np.eye(len(theta))):
        above, below = (curvature(linear, prior, at) for at in (theta + away, theta - away))
        assert gradient[k] == pytest.approx((above[0] - below[0]) / 2e-5, rel=1e-6, abs=1e-7)
        np.testing.assert_allclose(hessian[k], (above[1] - below[1]) / 2e-5, rtol=1e-3, atol=1e-4)


def test_a_fixed_hyperparameter_is_none():
    fixed = PRIOR.fixed("scale", 0.7)
    assert fixed.hyperparameters == ()
    np.testing.assert_allclose(fixed.precision(np.zeros(0)), PRIOR.precision(np.array([0.7])))
    assert PRIOR.fixed("other", 1.0) is PRIOR


def test_a_range_that_would_begin_above_its_end_is_that_end():
    """Observations that tell next to nothing, and a variance with an upper bound: case 94/26 without its orbit."""
    bounded = Prior.none(1).joined(Prior(np.zeros(2), np.ones((2, 1)), (Hyperparameter("scale", upper=1.0),)))
    linear = GaussianLikelihood(np.diag([1.0, 1e-9, 1e-9]), np.zeros(3), np.zeros(3))
    assert ranges(linear, bounded).tolist() == [[pytest.approx(np.log(1e6)), pytest.approx(np.log(1e6))]]
    assert maximise(linear, bounded) == pytest.approx(np.array([np.log(1e6)]))


def test_rounds_of_a_few_iterations_come_to_the_maximum():
    """Of a smooth path's law, from far: none is less likely than the one before."""
    prior, rng = SmoothPath(12, 0.0, 1.0).prior, np.random.default_rng(4)
    H = rng.normal(size=(80, 39))
    x = np.repeat(0.5 ** np.arange(13), 3) * rng.normal(size=39)
    linear = GaussianLikelihood(H.T @ H, H.T @ (H @ x + 0.1 * rng.normal(size=80)), np.zeros(39))
    theta = ranges(linear, prior).mean(axis=1)
    costs = [cost(linear, prior, theta)]
    for _ in range(8):
        theta = improved(linear, prior, theta)
        costs.append(cost(linear, prior, theta))
    assert (np.diff(costs) <= 1e-9).all()
    assert costs[1] < costs[0] - 1
    assert costs[-1] == pytest.approx(cost(linear, prior, maximise(linear, prior)), abs=0.01)


def test_what_is_not_known_of_a_start_is_sought_in_its_range():
    """With nothing known as without a start; with one of two at its maximum, the other is found."""
    H, _, y = observed(3, 0.4)
    halves = [Prior(np.zeros(6), np.ones((6, 1)), (Hyperparameter(name),)) for name in ("one", "other")]
    prior, linear = (
        Prior.none(2).joined(halves[0]).joined(halves[1]),
        GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14)),
    )
    best = maximise(linear, prior)
    for start in (np.full(2, np.nan), np.array([best[0], np.nan]), np.array([np.nan, best[1]])):
        for search in (maximise, improved):
            np.testing.assert_allclose(search(linear, prior, start), best, atol=0.02)


@pytest.mark.parametrize(("ratio", "kept"), [(5.5, False), (6.5, True)])
def test_an_optional_hyperparameter_is_given_up_unless_it_is_five_times_as_likely(ratio, kept):
    """Of one unknown beside a free one −2 ln p is ln(1 + λ v) − u² v/(1 + λ v): least, by r − 1 − ln r, at 1 + λ v = r,
    where r is u²/λ.

    A range of ten without an effect beside one of two that holds the mass of a maximum: 2 ln 5 = 3.2, of 2.8 and 3.6.
    """
    information = 4.0
    rhs = np.array([0.0, np.sqrt(ratio * information)])
    linear = GaussianLikelihood(information * np.eye(2), rhs, np.zeros(2))
    prior = Prior.none(1).joined(Prior(np.zeros(1), np.ones((1, 1)), (Hyperparameter("scale", optional=True),)))
    [found], [[none, _]] = maximise(linear, prior), ranges(linear, prior)
    assert found == pytest.approx(np.log((ratio - 1) / information) if kept else none, abs=1e-3)


def test_observations_that_nothing_explains_make_no_warning():
    """Of a solution that diverges: the variance is as great as its range allows."""
    H, _, y = observed(1, 0.4)
    linear = GaussianLikelihood(H.T @ H, H.T @ (1e152 * y), np.zeros(14))
    (theta,) = maximise(linear, PRIOR)
    assert theta == pytest.approx(ranges(linear, PRIOR)[0, 1], abs=1e-3)
