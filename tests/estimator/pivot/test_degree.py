"""The choice of the degree: the criterion, the sums of squares it is given, and the search."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from baryscope.estimator.adjustment.stereo import observations_of
from baryscope.estimator.dynamics.paths import Polynomial
from baryscope.estimator.methods import estimate
from baryscope.estimator.pivot.degree import (
    LOOKAHEAD,
    akaike_unbiased,
    at_degree,
    choose_degree,
    squares_by_degree,
)
from baryscope.estimator.pivot.drift import squares_by_size
from baryscope.estimator.pivot.free_attitudes import gauss_newton_step
from baryscope.estimator.pivot.refinement import linear_solution
from baryscope.estimator.registration.clusters import find_bodies
from free_paths import FEATURES, at_rest, fixed_case, on_parabola, turning
from synthetic import make_case


def design(values, unknowns):
    return np.linalg.qr(np.random.default_rng(0).normal(size=(values, unknowns)))[0]


def sums_of_squares(Q, y):
    """Sums of squares (draws, p) of y (draws, n) after regression on the first k = 1 … p orthonormal columns of Q."""
    return np.sum(y**2, axis=1)[:, None] - np.cumsum((y @ Q) ** 2, axis=1)


def test_the_criterion_is_aicc_with_the_unbiased_variance():
    """AICc from scipy's log-likelihood at its maximum: −2 ln L + 2K + 2K(K + 1)/(n − K − 1), K with the variance."""
    n, rng = 30, np.random.default_rng(1)
    Q, y = design(n, 9), rng.normal(size=n)
    for k in range(1, 10):
        residual = y - Q[:, :k] @ (Q[:, :k].T @ y)
        likelihood = norm.logpdf(residual, scale=np.sqrt(np.mean(residual**2))).sum()
        K = k + 1
        aicc = -2 * likelihood + 2 * K + 2 * K * (K + 1) / (n - K - 1)
        unbiased = n * np.log(n / (n - k))  # ln of the ratio of the two variances
        constant = n * (np.log(2 * np.pi) + 1)
        found = akaike_unbiased(n, np.array([residual @ residual]), np.array([float(k)]))[0]
        assert found == pytest.approx(aicc - constant + unbiased, rel=1e-12)


def test_the_penalty_is_aiccs_plus_one_per_unknown():
    """Monte Carlo: the deviance of new values n ln σ̂² + |y' − Qβ|²/σ̂², of which AICc is an unbiased prediction."""
    n, p, draws, rng = 40, 6, 40_000, np.random.default_rng(2)
    Q = design(n, p)
    y = rng.normal(size=(draws, n))
    new = rng.normal(size=(draws, n))
    for k in (1, 3, 6):
        squares = sums_of_squares(Q[:, :k], y)[:, -1]
        predicted = (y @ Q[:, :k]) @ Q[:, :k].T
        deviance = n * np.log(squares / n) + np.sum((new - predicted) ** 2, axis=1) / (squares / n) - n
        excess = akaike_unbiased(n, squares, np.full(draws, float(k))) - deviance
        expected = n * np.log(n / (n - k))  # k, to first order
        assert excess.mean() == pytest.approx(expected, abs=4 * excess.std() / np.sqrt(draws))
        assert expected == pytest.approx(k, rel=0.1)


def test_overfitting_is_as_rare_as_chi_squared_predicts():
    """With many values the penalty of three unknowns is 9: χ²₃ exceeds it in 2.9 % of draws, and AIC's 6 in 11 %."""
    n, draws, rng = 3000, 3000, np.random.default_rng(3)
    squares = sums_of_squares(design(n, 6), rng.normal(size=(draws, n)))[:, [2, 5]]
    criterion = akaike_unbiased(n, squares, np.array([3.0, 6.0]))
    share = np.mean(criterion[:, 1] < criterion[:, 0])
    expected = chi2.sf(9, 3)
    assert share == pytest.approx(expected, abs=4 * np.sqrt(expected / draws))


def test_the_criterion_does_not_depend_on_units():
    squares, unknowns = np.array([5.0, 4.0, 3.9]), np.array([3.0, 6.0, 9.0])
    metres = akaike_unbiased(50.0, squares, unknowns)
    millimetres = akaike_unbiased(50.0, 1e6 * squares, unknowns)
    np.testing.assert_allclose(np.diff(millimetres), np.diff(metres), atol=1e-11)


def test_models_without_degrees_of_freedom_are_never_chosen():
    found = akaike_unbiased(11.0, np.array([2.0, 1.0, 1.0, 1.0]), np.array([6.0, 8.0, 9.0, 12.0]))
    assert np.isfinite(found[:2]).all()
    assert np.isposinf(found[2:]).all()


def converged(bodies, observations, sampled, x):
    """The solution after eight Gauss–Newton steps, which has converged."""
    for _ in range(8):
        solution = gauss_newton_step(bodies, observations, sampled, x)
        bodies, x = solution.bodies, solution.x
    assert solution.step < 1e-12 * solution.squares.sum()
    return solution


@pytest.fixture(scope="module")
def parabola():
    """Bodies, observations, times and span of a body that turns by 7 °/s for 200 s on a parabola."""
    time, R = turning(200)
    tracks = make_case(time, R, on_parabola(time), FEATURES, noise=0.02, seed=5).tracks
    registered = find_bodies(tracks.position, tracks.seen)
    return registered, observations_of(tracks, tracks.seen), time, (time[0], time[-1])


def test_one_step_predicts_the_squares_of_a_fit_at_each_degree(parabola):
    """Against a separate fit at every degree; only roughly at degrees that do not fit."""
    registered, observations, time, span = parabola
    sampled = Polynomial(5, *span).at(time)
    bodies, x = linear_solution(registered, observations, sampled)
    predicted_squares = squares_by_degree(gauss_newton_step(bodies, observations, sampled, x))
    for degree in range(6):
        sampled = Polynomial(degree, *span).at(time)
        bodies, x = linear_solution(registered, observations, sampled)
        fitted = converged(bodies, observations, sampled, x)
        assert predicted_squares[degree] == pytest.approx(fitted.squares.sum(), rel=1e-6 if degree >= 2 else 0.1)


def test_the_same_step_gives_the_solution_at_a_lower_degree(parabola):
    registered, observations, time, span = parabola
    sampled = Polynomial(5, *span).at(time)
    bodies, x = linear_solution(registered, observations, sampled)
    solution = converged(bodies, observations, sampled, x)
    bodies, x = at_degree(solution, 2)
    assert x.shape == (9,)
    sampled = Polynomial(2, *span).at(time)
    there = gauss_newton_step(bodies, observations, sampled, x)
    assert there.squares.sum() == pytest.approx(squares_by_degree(solution)[2], rel=1e-6)
    assert there.step < 1e-6 * there.squares.sum()


def test_linear_squares_agree_with_numpys_least_squares(parabola):
    registered, _, time, span = parabola
    sampled = Polynomial(4, *span).at(time)
    (body,), (origin,) = registered.bodies, registered.origins
    for degree, found in zip((0, 2, 4), squares_by_size(registered, sampled, (3, 9, 15)), strict=True):
        path = Polynomial(degree, *span).at(time[body.frames]).jacobian
        rows = np.concatenate([body.attitude, path], axis=2).reshape(-1, 3 + path.shape[2])
        expected = np.linalg.lstsq(rows, origin.ravel(), rcond=None)[1][0]
        assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("best_degree", [0, 3, 9, 14])
def test_the_search_ends_at_the_criterions_minimum(parabola, best_degree):
    """For criteria with a single minimum, wherever the search starts."""

    def criterion(values, squares, unknowns):
        return np.abs(unknowns / 3 - 1 - best_degree)

    assert choose_degree(*parabola, criterion) == best_degree


def test_the_search_does_not_look_beyond_its_lookahead(parabola):
    def criterion(values, squares, unknowns):
        degree = unknowns / 3 - 1
        return np.where(degree > LOOKAHEAD, -1.0, degree / 10)

    assert choose_degree(*parabola, criterion) == 0


def test_few_frames_choose_a_degree_that_they_determine():
    """Three frames leave six values for path and offset, which allow a fixed point only."""
    time, R = turning(3, step=20.0)
    case = make_case(time, R, at_rest(time), FEATURES, noise=0.02)
    found = estimate(case.tracks)
    assert found.path == "fixed"


def test_exact_tracks_choose_the_degree_of_their_path():
    """Residuals that are rounding errors do not influence the choice."""
    time, R = turning(100)
    found = estimate(make_case(time, R, on_parabola(time), FEATURES).tracks)
    assert found.path == "polynomial:2"
    still = estimate(fixed_case(noise=0.0).tracks)
    assert still.path == "fixed"
