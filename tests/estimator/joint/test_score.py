"""The joint of two moving bodies by SCoRE: exact without noise, honest under white and correlated motion of skin."""

import numpy as np
import pytest
from scipy.stats import chi2

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.joint import joint
from baryscope.estimator.tracks import FeatureTracks
from baryscope.study.joints.judging import judged
from joints import SHAPE, TIME, TRUTH, recording


def test_without_noise_the_centre_is_exact():
    parent, child, centre = recording(np.random.default_rng(1), 0.0, 0.0)
    found = joint(parent, child, method="score")
    np.testing.assert_allclose(found.position, centre, atol=1e-9)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_covariance_is_honest(memory):
    """NEES of the centre in the child, referred to the true markers: its mean over 50 draws is near 3.

    The standard deviation of the mean is sqrt(6 / 50) = 0.35; the bandwidth is finite, so some more is allowed above.
    With memory it is 2.07 where the scores have what is claimed besides as a slide that follows the motion.
    """
    nees = []
    for seed in range(50):
        parent, child, _ = recording(np.random.default_rng(seed), 0.003, memory)
        found = joint(parent, child, method="score")
        to_truth = align(SHAPE[None], found.child_markers, np.ones((1, 4)))
        R = to_truth.rotation[0]
        error = R @ found.in_child + to_truth.translation[0] - TRUTH
        nees.append(error @ np.linalg.solve(R @ found.covariance[3:, 3:] @ R.T, error))
    assert 2.2 < np.mean(nees) < 4.2, np.mean(nees)


@pytest.mark.parametrize("motion", ["circles", "gait", "hinge"])
@pytest.mark.parametrize("noise", ["in step", "by angle", "by angle, each marker"])
def test_what_keeps_time_with_the_motion_is_claimed(motion, noise):
    """It looks like another centre, and leaves residuals that are smaller than the error: seven in ten answers and more
    had a NEES beyond 16.27, which is one of a thousand. Here at most one of 6 or 12 has; of true claims two have in
    7e-5. On a hinge the variance of such skin hangs on one or two squares: of F(3, 2) 0.16 are beyond 16.27 / 3, 1 of 6
    and 2 of 12. It shows least where each marker moves by itself.
    """
    draws = 12 if noise == "by angle, each marker" else 6
    allowed = draws // 6 if motion == "hinge" else 1
    nees = np.array([judged(motion, noise, 1, draw, "score")["nees"] for draw in range(draws)])
    assert np.sum(nees > chi2.ppf(0.999, 3)) <= allowed, nees


@pytest.mark.parametrize("sigma", [0.0005, 0.003])
def test_a_noisy_hinge_is_named_and_its_centre_free_along_the_axis(sigma):
    """The axis is x of the child: what is found is near it, and claimed within three radii of the markers along it."""
    for seed in range(10):
        parent, child, _ = recording(np.random.default_rng(seed), sigma, 0.5, hinge=True)
        found = joint(parent, child, method="score")
        to_truth = align(SHAPE[None], found.child_markers, np.ones((1, 4)))
        R = to_truth.rotation[0]
        assert found.hinge
        axis = R @ found.axis
        assert abs(axis[0]) > 0.99
        covariance = R @ found.covariance[3:, 3:] @ R.T
        assert np.sqrt(covariance[0, 0]) > 0.2
        error = R @ found.in_child + to_truth.translation[0] - TRUTH
        assert error @ np.linalg.solve(covariance, error) < 27.9  # of χ² with three degrees of freedom, 1e-5 (20 draws)
    ball, other, _ = recording(np.random.default_rng(1), sigma, 0.5)
    assert not joint(ball, other, method="score").hinge


def test_the_residual_of_a_marker_shows_which_one_is_loose():
    parent, child, _ = recording(np.random.default_rng(2), 0.001, 0.0)
    loose = child.position.copy()
    loose[:, 2] += 0.01 * np.random.default_rng(3).normal(size=loose[:, 2].shape)
    found = joint(parent, FeatureTracks(TIME, loose, child.labels), method="score")
    assert int(np.argmax(found.child_rms)) == 2
    assert found.child_rms[2] > 2 * np.max(found.parent_rms)


def test_a_probe_turns_about_a_point_of_the_room():
    _, child, centre = recording(np.random.default_rng(1), 0.0, 0.0)
    still = FeatureTracks(TIME, child.position - centre[:, None] + [1.0, 2.0, 3.0], child.labels)
    found = joint(None, still, method="score")
    np.testing.assert_allclose(found.in_parent, [1.0, 2.0, 3.0], atol=1e-9)
