"""The joint of two moving bodies: exact without noise, honest under white and under correlated motion of skin."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from baryscope.estimator.geometry.alignment import align
from baryscope.estimator.registration.joint import joint
from baryscope.estimator.tracks import FeatureTracks
from baryscope.models.errors import ComputationError, InputError

TIME = np.arange(600) / 50.0
TRUTH = np.array([0.02, -0.03, -0.2])  # of the joint, in the child's axes, from its origin
SHAPE = np.array([[0.1, 0.0, 0.0], [-0.08, 0.09, 0.0], [-0.07, -0.08, 0.03], [0.0, 0.02, 0.11]])


def recording(rng, sigma, memory, hinge=False):
    """Tracks of parent and child, and the true joint in the tracks' axes. memory: of an AR(1) noise of each segment."""
    t = TIME[:, None]
    turn = 0.7 * np.sin(2 * np.pi * np.array([0.31, 0.47, 0.23]) * t + [0, 1, 2])
    bend = 0.8 * np.sin(2 * np.pi * np.array([0.53, 0.37, 0.71]) * t + [2, 0, 1]) * ([1, 0, 0] if hinge else [1, 1, 1])
    R_T_P = Rotation.from_rotvec(turn).as_matrix()
    R_T_C = R_T_P @ Rotation.from_rotvec(bend).as_matrix()
    origin = np.array([0.5, 0.1, 1.0]) + 0.1 * np.sin(t + np.arange(3))
    centre = origin + R_T_P @ [0.1, 0.2, 0.3]
    tracks = []
    for R, place in ((R_T_P, origin), (R_T_C, centre - R_T_C @ TRUTH)):
        points = place[:, None] + SHAPE @ np.swapaxes(R, 1, 2)
        white = rng.normal(size=(len(TIME) + 500, 1, 3)) * sigma * np.sqrt(1 - memory**2)
        skin = lfilter([1], [1, -memory], white, axis=0)[500:]
        points = points + (R @ skin[:, 0, :, None])[..., 0][:, None]
        points = points + rng.normal(size=points.shape) * sigma / 4
        tracks.append(FeatureTracks(TIME, points, tuple("abcd")))
    return *tracks, centre


def test_without_noise_the_centre_is_exact():
    parent, child, centre = recording(np.random.default_rng(1), 0.0, 0.0)
    found = joint(parent, child)
    np.testing.assert_allclose(found.position, centre, atol=1e-9)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_covariance_is_honest(memory):
    """NEES of the centre in the child, referred to the true markers: its mean over 100 draws is near 3.

    The standard deviation of the mean is sqrt(6 / 100) = 0.24; the bandwidth is finite, so some more is allowed above.
    """
    nees = []
    for seed in range(100):
        parent, child, _ = recording(np.random.default_rng(seed), 0.003, memory)
        found = joint(parent, child)
        to_truth = align(SHAPE[None], found.child_markers, np.ones((1, 4)))
        R = to_truth.rotation[0]
        error = R @ found.in_child + to_truth.translation[0] - TRUTH
        nees.append(error @ np.linalg.solve(R @ found.covariance[3:, 3:] @ R.T, error))
    assert 2.2 < np.mean(nees) < 4.2, np.mean(nees)


def test_a_probe_turns_about_a_point_of_the_room():
    _, child, centre = recording(np.random.default_rng(1), 0.0, 0.0)
    still = FeatureTracks(TIME, child.position - centre[:, None] + [1.0, 2.0, 3.0], child.labels)
    found = joint(None, still)
    np.testing.assert_allclose(found.in_parent, [1.0, 2.0, 3.0], atol=1e-9)


def test_bodies_that_do_not_turn_and_other_times_are_refused():
    parent, child, _ = recording(np.random.default_rng(1), 0.0, 0.0, hinge=True)
    with pytest.raises(ComputationError, match="no single centre"):
        joint(parent, child)
    with pytest.raises(InputError, match="different times"):
        joint(parent, FeatureTracks(TIME + 1, child.position, child.labels))
