"""Wrong observations, made on purpose: which are found, and that right ones are left alone."""

import numpy as np
import pytest

from baryscope.estimator.adjustment.reweighting import GATE, reweighted
from baryscope.estimator.registration.screening import screen
from synthetic import ENVISAT, attitude, box_features, make_case

N, M, NOISE = 1000, 8, 0.02


@pytest.fixture(scope="module")
def clean():
    """A clean run: positions (n, m, 3), seen (n, m) with 20 % missing, and the features' places."""
    time = np.arange(float(N))
    features = box_features(M, (10, 5, 5), seed=2)
    R = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    position = make_case(time, R, np.tile([4.0, -19, 3], (N, 1)), features, noise=NOISE).tracks.position
    seen = np.random.default_rng(0).random((N, M)) < 0.8
    return position, seen, R


def shares(inliers, seen, wrong):
    """Of wrong observations those inliers, and of right ones those not."""
    return (inliers & wrong).sum() / max((seen & wrong).sum(), 1), (seen & ~wrong & ~inliers).sum() / seen.sum()


def test_clean_tracks_are_left_alone(clean):
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
    missed, lost = shares(inliers, seen, wrong)
    # Distances see of a blunder what lies along them: less than 5 deviations of a distance, 0.14 m, are some 4 % of
    # single distances, of which several are looked at; but where few features are right, nobody is left to disagree.
    assert missed < (0.1 if share == 0.3 else 0.02)
    assert lost < (0.1 if share == 0.3 else 0.01)


def test_swapped_labels_are_found(clean):
    position, seen, _ = clean
    position, wrong = position.copy(), np.zeros((N, M), dtype=bool)
    for begin, (one, two) in ((100, (0, 1)), (400, (2, 6)), (700, (3, 4))):
        rows = slice(begin, begin + 80)
        position[rows, [one, two]] = position[rows, [two, one]]
        wrong[rows, one] = wrong[rows, two] = True
    missed, lost = shares(screen(position, seen), seen, wrong)
    assert missed < 0.02
    assert lost < 0.02


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_a_feature_that_slides_is_found_once_it_has_gone_far(clean, share):
    """Along the body for the last part of the time, at 2 cm/s."""
    position, seen, R = clean
    start = int((1 - share) * N)
    position = position.copy()
    position[:, 3] += 0.02 * np.maximum(np.arange(N) - start, 0)[:, None] * (R @ [0.0, 0.6, 0.8])
    inliers = screen(position, seen)
    # While it is near its place, one of the others may look wrong to it, as in few frames as such a while is.
    assert (~inliers & seen)[:, np.arange(M) != 3].sum() < 0.001 * seen.sum()
    np.testing.assert_array_equal(inliers[:start, 3], seen[:start, 3])
    # Five deviations of a distance are 5 × √2 × 0.02 = 0.14 m; 1 m away is too far for every partner but those across.
    assert seen[start + 50 :, 3].sum() > 30
    assert inliers[start + 50 :, 3].sum() < 0.02 * seen[start + 50 :, 3].sum()


def test_many_features_are_compared_with_some_of_the_others():
    time = np.arange(300.0)
    R = attitude(ENVISAT, np.deg2rad([1.2, 2.2, 2.4]), time)
    features = box_features(60, (10, 5, 5), seed=2)
    position = make_case(time, R, np.zeros((300, 3)), features, noise=NOISE).tracks.position.copy()
    wrong = np.random.default_rng(3).random((300, 60)) < 0.1
    position[wrong] += [1.0, -2.0, 1.5]
    missed, lost = shares(screen(position, np.ones((300, 60), dtype=bool)), np.ones((300, 60), dtype=bool), wrong)
    assert missed < 0.02
    assert lost < 0.02


def test_weights_are_the_probability_of_a_right_observation():
    """e^(−d²/2) against e^(−GATE/2), at the noise that the median of χ²₃ shows, 2.366."""
    rng = np.random.default_rng(0)
    squares = (0.5 * rng.normal(size=(4000, 5, 3)) ** 2).sum(axis=2)  # of variance 0.5
    squares[0, :4] = 0.5 * np.array([GATE - 3, GATE, GATE + 3, 100.0])
    weight = np.ones((4000, 5))
    weight[1, 1] = squares[1, 1] = 0.0
    found = reweighted(squares, weight, 3 * weight.sum())
    np.testing.assert_allclose(found[0, :3], 1 / (1 + np.exp([-1.5, 0, 1.5])), atol=0.05)  # the noise's 1 %, times 20/2
    assert 0 < found[0, 3] < 1e-8
    assert found[1, 1] == 0
    # Of right observations, χ²₃ lies beyond the gate with 1.7e-4; the slope before it takes some 1e-3 from the others.
    assert found[2:].mean() > 0.998
    # The noise is told by the residuals' median, and not by a third that is wrong.
    squares[:, 0] = 1e4
    spoiled = reweighted(squares, weight, 3 * weight.sum())
    assert spoiled[:, 0].max() < 1e-8
    assert spoiled[2:, 1:].mean() > 0.998


def test_the_noise_is_that_of_observations_and_not_of_what_unknowns_left_of_it():
    """Half of the values are unknowns, so that squares are half of the noise; one that is GATE is on the gate."""
    rng = np.random.default_rng(0)
    weight = np.ones((4000, 5))
    squares = 0.5 * (rng.normal(size=(4000, 5, 3)) ** 2).sum(axis=2)
    squares[0, 0] = GATE
    found = reweighted(squares, weight, 1.5 * weight.sum())
    assert found[0, 0] == pytest.approx(0.5, abs=0.08)  # 3 % of the noise, times 20/2/4
    scaled = reweighted(4 * squares, weight, 1.5 * weight.sum())
    np.testing.assert_allclose(scaled, found, rtol=1e-9)


def test_old_weights_do_not_count_twice_and_no_residual_is_no_outlier():
    rng = np.random.default_rng(1)
    squares = (rng.normal(size=(400, 5, 3)) ** 2).sum(axis=2)
    squares[3, 3] = 1e3
    weight = np.ones((400, 5))
    first = reweighted(squares, weight, 3 * weight.sum())
    again = reweighted(first * squares, first, 3 * first.sum())
    np.testing.assert_allclose(again, first, atol=0.02)
    np.testing.assert_array_equal(reweighted(np.zeros((4, 3)), np.ones((4, 3)), 30.0), 1)
