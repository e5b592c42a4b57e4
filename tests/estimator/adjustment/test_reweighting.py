"""Simulated outliers: screening and reweighting find them and keep the inliers."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.reweighting import GATE, Mixture, reweighted
from baryscope.estimator.registration.screening import screen
from synthetic import ENVISAT, attitude, box_features, make_case

N, M, NOISE = 1000, 8, 0.02


@pytest.fixture(scope="module")
def clean():
    """A run without outliers: positions (n, m, 3), seen (n, m) with 20 % missing, and attitudes (n, 3, 3)."""
    time = np.arange(float(N))
    features = box_features(M, (10, 5, 5), seed=2)
    R = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    position = make_case(time, R, np.tile([4.0, -19, 3], (N, 1)), features, noise=NOISE).tracks.position
    seen = np.random.default_rng(0).random((N, M)) < 0.8
    return position, seen, R


def shares(inliers, seen, wrong):
    """The share of the outliers that count as inliers, and the share of the inliers that do not."""
    return (inliers & wrong).sum() / max((seen & wrong).sum(), 1), (seen & ~wrong & ~inliers).sum() / seen.sum()


def test_clean_tracks_are_not_changed(clean):
    position, seen, _ = clean
    np.testing.assert_array_equal(screen(position, seen), seen)
    np.testing.assert_array_equal(screen(position[:4], seen[:4]), seen[:4])
    np.testing.assert_array_equal(screen(position[:, :1], seen[:, :1]), seen[:, :1])


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3])
def test_blunders_are_found(clean, share):
    position, seen, _ = clean
    rng = np.random.default_rng(1)
    wrong = rng.random((N, M)) < share
    offset = 2.0 / np.sqrt(3) * rng.normal(size=position.shape)
    inliers = screen(position + np.where(wrong[..., None], offset, 0), seen)
    assert not (inliers & ~seen).any()
    accepted_outliers, rejected_inliers = shares(inliers, seen, wrong)
    # A distance shows the component of a blunder along it: below 5 standard deviations, 0.14 m, for some 4 % of single
    # distances, of which several are examined. With 30 % of blunders a frame may have too few inliers to reveal them.
    assert accepted_outliers < (0.1 if share == 0.3 else 0.02)
    assert rejected_inliers < (0.1 if share == 0.3 else 0.01)


def test_swapped_labels_are_found(clean):
    position, seen, _ = clean
    position, wrong = position.copy(), np.zeros((N, M), dtype=bool)
    for begin, (one, two) in ((100, (0, 1)), (400, (2, 6)), (700, (3, 4))):
        rows = slice(begin, begin + 80)
        position[rows, [one, two]] = position[rows, [two, one]]
        wrong[rows, one] = wrong[rows, two] = True
    accepted_outliers, rejected_inliers = shares(screen(position, seen), seen, wrong)
    assert accepted_outliers < 0.02
    assert rejected_inliers < 0.02


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_a_drifting_feature_is_found_once_its_error_is_large(clean, share):
    """The feature moves along the body at 2 cm/s for the last part of the time."""
    position, seen, R = clean
    start = int((1 - share) * N)
    position = position.copy()
    position[:, 3] += 0.02 * np.maximum(np.arange(N) - start, 0)[:, None] * (R @ [0.0, 0.6, 0.8])
    inliers = screen(position, seen)
    # While its error is small, one of the others may be rejected instead, in a few frames.
    assert (~inliers & seen)[:, np.arange(M) != 3].sum() < 0.001 * seen.sum()
    np.testing.assert_array_equal(inliers[:start, 3], seen[:start, 3])
    # 5 standard deviations of a distance are 5 × √2 × 0.02 = 0.14 m; 1 m shows in all distances but perpendicular ones.
    assert seen[start + 50 :, 3].sum() > 30
    assert inliers[start + 50 :, 3].sum() < 0.02 * seen[start + 50 :, 3].sum()


def test_many_features_are_compared_with_some_of_the_others():
    time = np.arange(300.0)
    R = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    features = box_features(60, (10, 5, 5), seed=2)
    position = make_case(time, R, np.zeros((300, 3)), features, noise=NOISE).tracks.position.copy()
    wrong = np.random.default_rng(3).random((300, 60)) < 0.1
    position[wrong] += [1.0, -2.0, 1.5]
    accepted_outliers, rejected_inliers = shares(
        screen(position, np.ones((300, 60), dtype=bool)), np.ones((300, 60), dtype=bool), wrong
    )
    assert accepted_outliers < 0.02
    assert rejected_inliers < 0.02


def test_weights_are_the_probability_of_an_inlier():
    """The odds are e^(−d²/2) against e^(−GATE/2), with the noise from the median of χ²₃, 2.366."""
    rng = np.random.default_rng(0)
    squares = (0.5 * rng.normal(size=(4000, 5, 3)) ** 2).sum(axis=2)  # of variance 0.5
    squares[0, :4] = 0.5 * np.array([GATE - 3, GATE, GATE + 3, 100.0])
    weight = np.ones((4000, 5))
    weight[1, 1] = squares[1, 1] = 0.0
    found = reweighted(squares, weight, 3 * weight.sum())
    # The noise has an error of 1 %, which the weight at the gate multiplies by 20/2/4.
    np.testing.assert_allclose(found[0, :3], 1 / (1 + np.exp([-1.5, 0, 1.5])), atol=0.05)
    assert 0 < found[0, 3] < 1e-8
    assert found[1, 1] == 0
    # χ²₃ puts 1.7e-4 of the inliers beyond the gate; weights just below it reduce the mean by some 1e-3.
    assert found[2:].mean() > 0.998
    # The median determines the noise, so that a fifth of outliers hardly changes it.
    squares[:, 0] = 1e4
    with_outliers = reweighted(squares, weight, 3 * weight.sum())
    assert with_outliers[:, 0].max() < 1e-8
    assert with_outliers[2:, 1:].mean() > 0.998


def test_the_noise_estimate_counts_the_unknowns():
    """With half as many unknowns as values, squared residuals are half the noise; GATE variances give weight 1/2."""
    rng = np.random.default_rng(0)
    weight = np.ones((4000, 5))
    squares = 0.5 * (rng.normal(size=(4000, 5, 3)) ** 2).sum(axis=2)
    squares[0, 0] = GATE
    found = reweighted(squares, weight, 1.5 * weight.sum())
    assert found[0, 0] == pytest.approx(0.5, abs=0.08)  # 3 % of the noise, times 20/2/4
    scaled = reweighted(4 * squares, weight, 1.5 * weight.sum())
    np.testing.assert_allclose(scaled, found, rtol=1e-9)


def test_reweighting_is_idempotent_and_zero_residuals_are_inliers():
    rng = np.random.default_rng(1)
    squares = (rng.normal(size=(400, 5, 3)) ** 2).sum(axis=2)
    squares[3, 3] = 1e3
    weight = np.ones((400, 5))
    first = reweighted(squares, weight, 3 * weight.sum())
    again = reweighted(first * squares, first, 3 * first.sum())
    np.testing.assert_allclose(again, first, atol=0.02)
    np.testing.assert_array_equal(reweighted(np.zeros((4, 3)), np.ones((4, 3)), 30.0), 1)


@pytest.mark.parametrize("dof", [3.0, 1.8, 1.0])
@pytest.mark.parametrize("ratio, share", [(16.0, 0.28), (100.0, 0.1)])
def test_outliers_near_by_have_a_share_and_a_variance(dof, ratio, share):
    """Drawn from the mixture itself: the median's noise would be up to a quarter too large. The gate is where both are
    as likely. Of 6000 inliers at least, the variance is known to 1/√3000 = 2 %, more with what is taken for another.
    """
    rng = np.random.default_rng(4)
    wrong = rng.random(9000) < share
    squares = 0.25 * np.where(wrong, ratio, 1.0) * rng.chisquare(dof, 9000)
    found = Mixture.of(squares, dof / 3, 0.0)
    assert found.variance == pytest.approx(0.25, rel=0.08)
    expected = (2 * np.log(1 / share - 1) + dof * np.log(ratio)) / (1 - 1 / ratio)
    assert found.gate == pytest.approx(min(expected, GATE), rel=0.1)
    # the weights are probabilities: as many outliers as there are, in the mean
    assert found.weights(squares).mean() == pytest.approx(1 - share, abs=0.02)


def test_where_there_are_few_outliers_or_none_the_gate_is_that_of_few():
    rng = np.random.default_rng(5)
    for dof in (3.0, 1.0):
        assert Mixture.of(rng.chisquare(dof, 600), dof / 3, 0.0).gate == GATE
    squares = rng.chisquare(3.0, 600)
    squares[:30] = 1e4
    assert Mixture.of(squares, 1.0, 0.0).gate == GATE
    assert Mixture.of(np.zeros(10), 1.0, 1e-9).variance == 1e-9
