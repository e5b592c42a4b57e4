"""The posterior over uncertain hyperparameters: against truths in repeated draws, and against dense grids."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.hyperparameters import integration
from baryscope.estimator.hyperparameters.evidence import (
    BELOW,
    NO_EFFECT,
    GaussianLikelihood,
    conditional,
    cost,
    maximise,
    ranges,
)
from baryscope.estimator.hyperparameters.integration import (
    BEYOND,
    GRID_END,
    LEAST_EFFECT,
    NINETY,
    Posterior,
    posterior,
)
from baryscope.estimator.hyperparameters.mixture import Reduced
from baryscope.estimator.paths.path import LONGEST, SmoothPath
from baryscope.estimator.paths.prior import Hyperparameter, Prior
from baryscope.estimator.paths.process_noise import ProcessNoisePath
from scaled_unknowns import PRIOR, observed


@pytest.mark.parametrize("variance", [1e-6, 0.01, 1.0])
def test_the_posterior_covers_the_truth(variance):
    """The mean of 150 values of χ²₂ has a standard deviation of 2/√150 = 0.16."""
    squares = []
    for seed in range(150):
        H, x, y = observed(seed, variance)
        linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
        theta = maximise(linear, PRIOR)
        found = posterior(linear, PRIOR, theta)
        error = found.mean - x
        squares.append(error[:2] @ np.linalg.solve(found.covariance[:2, :2], error[:2]))
        assert np.linalg.eigvalsh(found.covariance).min() > 0
    assert np.mean(squares) == pytest.approx(2, abs=0.5)


def test_the_posterior_has_the_mean_over_the_hyperparameter():
    """Against a dense grid of all its range, with what is there below it."""
    prior = Prior.none(2).joined(Prior(PRIOR.offset[2:], PRIOR.slopes[2:], (Hyperparameter("scale", optional=True),)))
    for seed in range(5):
        H, _, y = observed(seed, 0.01)
        linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
        low, high = ranges(linear, prior)[0]
        grid = np.linspace(low + np.log(LEAST_EFFECT / NO_EFFECT), high, 1000)
        points, share = np.append(low, grid), np.append(BELOW, np.full(1000, grid[1] - grid[0]))
        costs = np.array([cost(linear, prior, np.array([at])) for at in points])
        weight = share * np.exp(-(costs - costs.min()) / 2)
        expected = weight @ [conditional(linear, prior, np.array([at]))[0] for at in points] / weight.sum()
        found = posterior(linear, prior, maximise(linear, prior))
        deviation = np.sqrt(np.diag(found.covariance))
        np.testing.assert_allclose(found.mean / deviation, expected / deviation, atol=0.05)


@pytest.mark.parametrize("variance", [0.0, 0.003, 0.01, 0.03])
def test_what_is_optional_is_not_claimed_away(variance):
    """Of 200 draws: where there is none, claims are hardly wider; where it is at the edge of what the observations
    tell, few errors are beyond them. χ²₂ exceeds 13.8 once in a thousand draws.
    """
    prior = Prior.none(2).joined(Prior(PRIOR.offset[2:], PRIOR.slopes[2:], (Hyperparameter("scale", optional=True),)))
    squares = []
    for seed in range(200):
        H, x, y = observed(seed, variance)
        linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
        found = posterior(linear, prior, maximise(linear, prior))
        error = (found.mean - x)[:2]
        squares.append(error @ np.linalg.solve(found.covariance[:2, :2], error))
    assert 1.6 < np.mean(squares) < 2.6
    assert np.mean(np.array(squares) > 13.8) < 0.01


def test_a_step_along_a_principal_axis_is_of_the_lattices_deviations():
    """With many unknowns −2 ln p is nearly quadratic at its minimum: a step of s deviations raises it by s²."""
    slopes = np.column_stack([np.ones(600), np.linspace(-1, 1, 600)])
    prior = Prior(np.zeros(600), slopes, (Hyperparameter("size", -10, 10), Hyperparameter("trend", -10, 10)))
    x = np.exp(slopes @ [0.5, 1.0] / 2) * np.random.default_rng(3).normal(size=600)
    linear = GaussianLikelihood(100 * np.eye(600), 100 * x, np.zeros(600))
    theta, bounds = maximise(linear, prior), ranges(linear, prior)
    steps = integration._principal_steps(linear, prior, theta, np.ones(2, dtype=bool), bounds)
    assert np.linalg.matrix_rank(steps) == 2
    raised = [cost(linear, prior, theta + way * step) - cost(linear, prior, theta) for step in steps for way in (-1, 1)]
    np.testing.assert_allclose(raised, integration.LATTICE_STEP**2, rtol=0.15)


def test_without_hyperparameters_the_posterior_is_that_of_least_squares():
    H, _, y = observed(2, 1.0)
    linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
    found = posterior(linear, Prior.none(14), maximise(linear, Prior.none(14)))
    np.testing.assert_allclose(found.mean, np.linalg.lstsq(H, y, rcond=None)[0], rtol=1e-8)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(H.T @ H), rtol=1e-8)


def test_an_optional_hyperparameter_without_an_effect_is_not_significant():
    """Others of its values may be a little more likely than none, but not by what its range has below."""
    unknown = Prior.none(2).joined(Prior(PRIOR.offset[2:], PRIOR.slopes[2:], (Hyperparameter("scale", optional=True),)))
    found = []
    for seed in range(20):
        H, _, y = observed(seed, 1e-3)
        linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
        theta = maximise(linear, unknown)
        if theta[0] == ranges(linear, unknown)[0, 0]:
            found.append(posterior(linear, unknown, theta).significance[0])
    assert len(found) > 10
    assert found == [0.0] * len(found)


def test_rounding_that_makes_nothing_far_less_likely_leaves_it_likely(monkeypatch):
    """Case 109/4 without its orbit: near the end of the range, where nothing has an effect, −2 ln p fell by 10⁹."""
    unknown = Prior.none(2).joined(Prior(PRIOR.offset[2:], PRIOR.slopes[2:], (Hyperparameter("scale", optional=True),)))
    H, _, y = observed(0, 1e-3)
    linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
    theta = ranges(linear, unknown)[:, 0] + 1e-6
    expected = conditional(linear, unknown, theta)[1]
    kept = integration.likeliest_without

    def rounded(*problem):
        return kept(*problem)[0], kept(*problem)[1] + 1e9

    monkeypatch.setattr(integration, "likeliest_without", rounded)
    monkeypatch.setattr(integration, "_along", lambda linear, prior, theta, *_: ([theta], [cost(linear, prior, theta)]))
    found = posterior(linear, unknown, theta)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(("theta", "low", "high"), [(1.0, -NINETY, NINETY), (-3.0, -3.0, NINETY), (4.0, -NINETY, 4.0)])
def test_the_bounds_of_a_hyperparameter_hold_its_value(theta, low, high):
    """The interval is that of the mixture; a value at an end of its range may lie outside."""
    none = np.zeros(0)
    found = Posterior(np.array([theta]), np.array([[-1.0, 1.0]]), none, none, none, none, none, none)
    assert found.bounds(0) == pytest.approx((np.exp(low), np.exp(high)))


def test_a_hyperparameter_that_rounding_has_put_below_its_bound_leaves_the_others_their_uncertainty():
    """Bounds are those of the last linearisation, θ that of the one before."""
    H, _, y = observed(3, 0.4)
    halves = [Prior(np.zeros(6), np.ones((6, 1)), (Hyperparameter(name),)) for name in ("one", "other")]
    prior = Prior.none(2).joined(halves[0]).joined(halves[1])
    linear = GaussianLikelihood(H.T @ H, H.T @ y, np.zeros(14))
    lowest = np.array([maximise(linear, prior)[0], ranges(linear, prior)[1, 0]])
    at, below = (posterior(linear, prior, lowest - [0.0, apart]) for apart in (0.0, 1e-9))
    assert np.ptp(at.interval[0]) > 0.1
    np.testing.assert_allclose(below.interval[0], at.interval[0], rtol=1e-6)


def test_what_others_explain_is_not_due_to_an_optional_one():
    """Two groups of unknowns have the same columns: either explains the observations, and the optional one has none."""
    rng = np.random.default_rng(5)
    H = rng.normal(size=(80, 8))
    y = H @ rng.normal(size=8) + rng.normal(size=80)
    both = np.hstack([H, H])
    scales = tuple(Prior(np.zeros(8), np.ones((8, 1)), (Hyperparameter(n, optional=n == "b"),)) for n in "ab")
    prior, linear = scales[0].joined(scales[1]), GaussianLikelihood(both.T @ both, both.T @ y, np.zeros(16))
    bounds = ranges(linear, prior)
    start = np.array([bounds[0, 0], 0.0])  # all is due to the optional one
    for theta in (maximise(linear, prior, start), maximise(linear, prior, np.array([bounds[0, 0], np.nan]))):
        assert theta[1] == bounds[1, 0]
    assert theta[0] == pytest.approx(maximise(linear, prior)[0], abs=0.05)
    # Two explanations that are alike: the mixture holds those in which one of the two has no effect.
    other = np.array([bounds[0, 0], theta[0]])
    found = posterior(linear, prior, other)
    assert found.significance[1] == pytest.approx(0, abs=0.1)
    assert np.trace(found.covariance[:8, :8]) > 1  # at `other` it is as small as its prior


@pytest.mark.parametrize("optional", [False, True])
def test_scatter_widens_what_the_observations_do_not_tell(optional):
    """Three of twelve unknowns have hardly any effect: theirs is the law's variance, widened; others hardly change.

    Of a law that is optional they were widened twice as much, by the number of the point whose covariance is claimed.
    """
    rng = np.random.default_rng(6)
    H = np.hstack([10 * rng.normal(size=(60, 9)), 1e-3 * rng.normal(size=(60, 3))])
    scale = Hyperparameter("scale", optional=optional)
    law = Prior.none(1).joined(Prior(np.zeros(11), np.ones((11, 1)), (scale,)))
    linear = GaussianLikelihood(H.T @ H, H.T @ (H @ rng.normal(size=12) + rng.normal(size=60)), np.zeros(12))
    theta = maximise(linear, law)
    plain = np.diag(posterior(linear, law, theta).covariance)
    wider = np.diag(posterior(linear, replace(law, scatter=1.5), theta).covariance)
    assert wider[:9] == pytest.approx(plain[:9], rel=0.1)
    assert wider[9:] - plain[9:] == pytest.approx(np.exp(theta[0]) * np.expm1(1.5) * np.ones(3), rel=0.01)


@pytest.mark.parametrize("coefficients", [(3.0, 0.02, 0.3), (3.0, 0.02, 0.0), (3.0, 1.0, 0.4), (0.0, 0.0, 0.0)])
def test_a_smooth_path_is_averaged_over_its_whole_law(coefficients):
    """Coefficients of a path of which the second and third may be nothing: a maximum at the bounds of the law too."""
    rng = np.random.default_rng(7)
    path = SmoothPath(5, 0.0, 1.0)
    prior = replace(path.prior, scatter=0.0)
    H = rng.normal(size=(24, path.size)) * np.repeat([1.0, 3.0, 1.0, 0.3, 0.1, 0.1], 3)
    x = np.zeros((6, 3))
    x[1:4] = np.array(coefficients)[:, None] * rng.normal(size=(3, 3))
    linear = GaussianLikelihood(H.T @ H, H.T @ (H @ x.ravel() + rng.normal(size=24)), np.zeros(path.size))
    theta = maximise(linear, prior)
    found, expected = posterior(linear, prior, theta).about_likeliest, over_grid(linear, prior, theta)
    ratio = np.sqrt(np.diag(found) / np.diag(expected))
    assert ratio[:6] == pytest.approx(np.ones(6), abs=0.1)  # of the place and the slope, which are told
    assert ratio[6:12] == pytest.approx(np.ones(6), abs=0.25)
    if coefficients[2] != 0.4:  # else the rest hangs on improbable laws that hardly decrease, which no lattice reaches
        assert ((ratio > 0.5) & (ratio < 1.8)).all()


def test_unknowns_whose_prior_stays_the_same_may_be_eliminated(monkeypatch):
    """A smooth path with 36 modes of process noise: the posterior is that of all its unknowns at each point."""
    rng = np.random.default_rng(3)
    path = ProcessNoisePath(SmoothPath(8, 0.0, 1.0), 0.0, 1.0)
    H = path.at(np.linspace(0.0, 1.0, 60)).jacobian.reshape(-1, path.size) / 0.1
    linear = GaussianLikelihood(H.T @ H, H.T @ rng.normal(size=len(H)), rng.normal(size=path.size))
    theta = maximise(linear, path.prior)
    found, of, sizes = posterior(linear, path.prior, theta), Reduced.of, []

    def whole(linear, prior, theta, changing):
        reduced = of(linear, prior, theta, np.ones_like(changing))
        sizes.append((int(changing.sum()), len(reduced.linear.x)))
        return reduced

    monkeypatch.setattr(Reduced, "of", whole)
    expected = posterior(linear, path.prior, theta)
    assert sizes == [(24, path.size)]
    one = np.sqrt(np.diag(expected.covariance))
    np.testing.assert_allclose((found.covariance - expected.covariance) / np.outer(one, one), 0.0, atol=1e-6)
    np.testing.assert_allclose((found.mean - expected.mean) / one, 0.0, atol=1e-6)


def test_a_smooth_path_is_claimed_alike_along_any_axes():
    """One whose depth is told ten times worse, in axes that are turned. The law scattered along the coordinates, and
    deviations of places differed by up to 3 %; what is left of that is from where the range of a variance begins.
    """
    rng = np.random.default_rng(12)
    path = SmoothPath(8, 0.0, 1.0)
    jacobian = path.at(np.linspace(0.0, 1.0, 60)).jacobian
    H = (jacobian / np.array([0.1, 0.1, 1.0])[:, None]).reshape(-1, path.size)
    x = np.append(np.repeat([3.0, 1.0, 0.3], 3), np.zeros(path.size - 9)) * rng.normal(size=path.size)
    linear = GaussianLikelihood(H.T @ H, H.T @ (H @ x + rng.normal(size=len(H))), np.zeros(path.size))
    turn = np.kron(np.eye(path.size // 3), Rotation.from_rotvec([0.7, -0.5, 0.9]).as_matrix())
    one, other = (posterior(at, path.prior, maximise(at, path.prior)) for at in (linear, linear.along(turn)))
    back = turn @ other.covariance @ turn.T
    places = [np.einsum("nip,pq,niq->ni", jacobian, found, jacobian) for found in (one.covariance, back)]
    np.testing.assert_allclose(np.sqrt(places[1] / places[0]), 1.0, atol=0.01)


def test_a_smooth_path_of_which_nothing_is_told_is_longer_than_any():
    """As information of the offset takes all of the path's: its first coefficient has no range left."""
    prior = SmoothPath(4, 0.0, 1.0).prior
    information = np.diag(np.repeat([1.0, 0.0], [3, 12]))
    linear = GaussianLikelihood(information, np.zeros(15), np.zeros(15))
    assert np.ptp(ranges(linear, prior)[0]) == 0
    found = posterior(linear, prior, maximise(linear, prior))
    np.testing.assert_allclose(np.diag(found.covariance)[:3], 1.0, rtol=1e-6)
    assert (np.diag(found.covariance)[3:6] >= LONGEST**2 * (1 - 1e-6)).all()


def over_grid(linear, prior, theta):
    """The second moment of x about its mean for θ, over a grid of all three hyperparameters' ranges.

    As far as −2 ln p is at most GRID_END above the least: beyond, the mean of a variance that is not told has no bound
    but that of the range. What is there of the first at its lower bound is as likely as all the rest, of which it is
    uniform in the root, as likely as BELOW factors of e at θ, and the others are uniform over their ranges. The share
    of all the rest, of probability p, in the covariance is that of the quantiles of χ² for p and for certainty.
    """
    bounds = ranges(linear, prior)
    axes = [np.linspace(low, high, n) for (low, high), n in zip(bounds, (32, 14, 15), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    costs = np.array([cost(linear, prior, at) for at in points])
    weight = np.where(costs < costs.min() + GRID_END, np.exp(-(costs - costs.min()) / 2), 0.0)
    none = np.array([bounds[0, 0], *theta[1:]])
    odds = BELOW * np.exp(-(cost(linear, prior, none) + none[0] - theta[0] - costs.min()) / 2)
    mass = weight.sum() * (axes[0][1] - axes[0][0]) / (14 * 15)
    probability = mass / (mass + odds)
    rest, resting = (posterior_of(linear, prior, *one) for one in ((points, weight / weight.sum()), ([none], [1.0])))
    mean = probability * rest[0] + (1 - probability) * resting[0]
    share = chi2.isf(min(BEYOND / probability, 1), 3) / chi2.isf(BEYOND, 3)
    total = np.outer(mean - conditional(linear, prior, theta)[0], mean - conditional(linear, prior, theta)[0])
    for part, (own, covariance) in ((share, rest), (1 - share, resting)):
        total += part * (covariance + np.outer(own - mean, own - mean))
    return total


def posterior_of(linear, prior, points, weight):
    """The mean (p,) and covariance (p, p) of x for weights of points."""
    found = [(share, *conditional(linear, prior, at)) for share, at in zip(weight, points, strict=True) if share > 0]
    mean = sum(share * own for share, own, _ in found)
    return mean, sum(share * (covariance + np.outer(own - mean, own - mean)) for share, own, covariance in found)


@pytest.mark.parametrize("count", [20, 200, 1000])
def test_an_interval_is_as_wide_as_its_likelihood_however_many_tell_it(count):
    """Of n unknowns that are observed without an error, −2 ln p = n θ + Σ x² e^−θ: a deviation of √(2/n) of θ. The sum
    in steps of two of them has 0.92 of it. In steps of 0.7 it had none from n = 200 on.
    """
    x = np.random.default_rng(5).normal(0.0, 0.3, count)
    own = Prior(np.zeros(count), np.ones((count, 1)), (Hyperparameter("scale", optional=True),))
    prior = Prior.none(1).joined(own)
    linear = GaussianLikelihood(1e9 * np.eye(count + 1), 1e9 * np.append(5.0, x), np.zeros(count + 1))
    theta = maximise(linear, prior)
    assert theta[0] == pytest.approx(np.log(np.mean(x**2)), abs=0.01)
    found = posterior(linear, prior, theta)
    assert np.ptp(found.interval[0]) / 2 == pytest.approx(np.sqrt(2 / count), rel=0.15)
    low, high = found.bounds(0)
    assert low < np.exp(theta[0]) < high
