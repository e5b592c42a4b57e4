import numpy as np
import pytest

from baryscope.estimator.screws.polynomial import HIGHEST_DEGREE, fit_path


def path(time):
    scaled = time / 3000 - 1
    return np.stack([3 + scaled**3, 2 - scaled, 0.5 * scaled**2], axis=1)


def samples(n=2000, noise=0.01, seed=0):
    time = np.linspace(0, 6000, n)
    return time, path(time) + noise * np.random.default_rng(seed).normal(size=(n, 3))


def test_a_polynomial_of_the_right_degree_is_exact():
    time, position = samples(noise=0.0)
    fitted = fit_path(time, position, np.ones(len(time)), (0.0, 6000.0), degree=3)
    np.testing.assert_allclose(fitted(time), position, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_the_data_choose_the_degree_and_gaps_are_not_overshot(seed):
    time, position = samples(seed=seed)
    seen = (time > 400) & ((time < 2000) | (time > 3000)) & (time < 5500)
    fitted = fit_path(time[seen], position[seen], np.ones(seen.sum()), (0.0, 6000.0), degree=None)
    assert fitted.degree in (3, 4)
    # Ten times the standard error 0.01 √(4 coefficients/1450) of a fit, for the ends are extrapolated.
    assert np.abs(fitted(time) - path(time)).max() < 0.01


def test_a_constant_stays_a_constant_across_a_long_blackout():
    time, _ = samples()
    position = np.random.default_rng(3).normal(size=(len(time), 3))
    seen = (time < 1500) | (time > 5000)
    fitted = fit_path(time[seen], position[seen], np.ones(seen.sum()), (0.0, 6000.0), degree=None)
    assert fitted.degree == 0


def test_an_orbit_seen_in_inertial_axes():
    time = np.linspace(0, 6000, 3000)
    turn = 2 * np.pi * time / 6000
    circle = 20 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    fitted = fit_path(
        time, circle + 0.01 * np.random.default_rng(1).normal(size=circle.shape), np.ones(3000), (0, 6000), None
    )
    # 20 m in a full turn: the Chebyshev series 40 J_k(π) falls below 3 mm at k = 10.
    assert fitted.degree >= 9
    assert np.abs(fitted(time) - circle).max() < 0.02


def test_outliers_lose_their_weight():
    time, position = samples()
    wild = np.random.default_rng(4).random(len(time)) < 0.1
    position[wild] += 50.0
    fitted = fit_path(time, position, np.ones(len(time)), (0.0, 6000.0), degree=None)
    assert fitted.rejected == wild.sum()
    assert np.abs(fitted(time) - path(time)).max() < 0.005


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_few_samples(n):
    time, position = samples(n=6, noise=0.0)
    fitted = fit_path(time[:n], position[:n], np.ones(n), (0.0, 6000.0), degree=None)
    assert fitted.degree < n
    assert np.isfinite(fitted(time)).all()
    assert fit_path(time[:n], position[:n], np.ones(n), (0.0, 6000.0), degree=HIGHEST_DEGREE).degree == n - 1
