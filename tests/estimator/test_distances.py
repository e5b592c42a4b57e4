"""Features of a turning body keep their distances from its centre of mass, not from another path."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from baryscope.estimator.distances import contradict

FRAMES, FEATURES, NOISE = 40, 12, 0.02
POINTS = np.random.default_rng(1).uniform(-3.0, 3.0, (FEATURES, 3))
R = Rotation.from_rotvec(np.outer(np.arange(FRAMES), [0.1, 0.3, -0.2])).as_matrix()
VARIANCE, EXACT = np.full((FRAMES, FEATURES), NOISE**2), np.zeros((FRAMES, 3, 1))
DRIFT = np.linspace(0.0, 1.0, FRAMES)[:, None] * [1.0, 0.5, -0.2]


def arms(seed):
    noise = NOISE * np.random.default_rng(seed).standard_normal((FRAMES, FEATURES, 3))
    return np.einsum("nij,mj->nmi", R, POINTS) + noise


@pytest.mark.parametrize("seed", range(20))
def test_noise_alone_does_not_contradict(seed):
    assert not contradict(arms(seed), VARIANCE, EXACT, 0.0)


def test_noise_contradicts_as_seldom_as_its_limit_says():
    """Of 10,000 features each by itself one in 10,000 does; more than that makes 5 in less than a thousandth."""
    noise = np.random.default_rng(4).normal(0.0, NOISE, (10_000, FRAMES, 1, 3))
    wrong = sum(contradict(one + POINTS[0], VARIANCE[:, :1], EXACT, 0.0) for one in noise)
    assert wrong <= binom.isf(1e-3, len(noise), 1e-4)


def test_an_offset_that_turns_with_the_body_does_not_and_a_drift_does():
    arm = arms(1)
    assert not contradict(arm + (R @ [2.0, 0.0, 1.0])[:, None], VARIANCE, EXACT, 0.01)
    assert contradict(arm + DRIFT[:, None], VARIANCE, EXACT, 0.01)


def test_a_drift_that_is_allowed_for_does_not():
    assert not contradict(arms(1) + DRIFT[:, None], VARIANCE, DRIFT[:, :, None], 0.01)


def test_a_path_that_is_off_by_the_same_all_the_time_allows_for_no_drift():
    """Of a body at rest: such an error changes no distance, however uncertain it is."""
    arm, off = POINTS + arms(1) - np.einsum("nij,mj->nmi", R, POINTS), np.tile([10.0, 5.0, -2.0], (FRAMES, 1))
    assert not contradict(arm, VARIANCE, off[:, :, None], 0.01)
    assert contradict(arm + DRIFT[:, None], VARIANCE, off[:, :, None], 0.01)


def test_outliers_do_not():
    """A tenth of the observations; of labels that last for four frames, one in twenty halves has two of them."""
    share, rng = 0.1, np.random.default_rng(3)
    arm = arms(2)
    arm += (rng.random((FRAMES, FEATURES)) < share)[:, :, None] * rng.uniform(-3.0, 3.0, arm.shape)
    brief = np.full((FRAMES, FEATURES * FRAMES // 4, 3), np.nan)
    for group in range(FRAMES // 4):
        rows = slice(4 * group, 4 * group + 4)
        brief[rows, FEATURES * group : FEATURES * (group + 1)] = arm[rows]
    variance = np.full(brief.shape[:2], NOISE**2)
    assert not contradict(brief, variance, EXACT, share)
    # As many as one expects, a third of the labels, would be no chance if there were few outliers.
    assert binom.sf(1, 2, 0.01) < 1e-3
    assert contradict(brief, variance, EXACT, 0.01)
    assert contradict(brief + 4 * DRIFT[:, None], variance, EXACT, share)


def test_features_that_are_seen_once_tell_nothing():
    once = np.full((FRAMES, FRAMES, 3), np.nan)
    once[np.arange(FRAMES), np.arange(FRAMES)] = arms(1)[:, 0] + DRIFT
    assert not contradict(once, np.full(once.shape[:2], NOISE**2), EXACT, 0.01)
