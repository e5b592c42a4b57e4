"""A second rigid body in the tracks: the chaser's arm, other debris; and what is none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator import FeatureTracks, PathOptions, estimate
from baryscope.estimator.findings import OtherBody
from baryscope.estimator.registration.screening import bodies_beside
from baryscope.estimator.result import Status

TIME, NOISE, CENTRE = np.arange(200.0), 0.01, np.array([1.0, -2.0, 15.0])
FIXED = PathOptions(trajectory="fixed")


def tumbling(rng, features, centre=CENTRE, rate=0.05):
    """Positions (n, m, 3) of features of a symmetric top that turns freely about a centre, without noise."""
    precession = Rotation.from_rotvec(rate * TIME[:, None] * np.array([0.3, 0.9, 0.1]))
    R = (precession * Rotation.from_rotvec(1.5 * rate * TIME[:, None] * np.array([0.0, 0.6, 0.8]))).as_matrix()
    points = rng.normal(size=(features, 3)) * [1.0, 0.8, 0.6] + [0.3, -0.2, 0.1]
    return centre + points @ np.swapaxes(R, 1, 2)


def seen_of(rng, *bodies):
    """Tracks of bodies, one after the other, with noise."""
    position = np.concatenate(bodies, axis=1)
    labels = tuple(f"f{index}" for index in range(position.shape[1]))
    return FeatureTracks(TIME, position + NOISE * rng.normal(size=position.shape), labels)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("arm", [4, 6])
def test_a_chasers_arm_is_named_and_left_out(seed, arm):
    """At rest in the camera's axes, of ten features it has four or six: the other ones turn.

    Without a word, six answers were off by 5 m and more, whatever they claimed.
    """
    rng = np.random.default_rng(seed)
    target = tumbling(rng, 10 - arm)
    at_rest = np.broadcast_to(0.3 * CENTRE + 0.4 * rng.normal(size=(arm, 3)), (200, arm, 3))
    tracks = seen_of(rng, target, at_rest)
    found = estimate(tracks, options=FIXED)
    assert [one for one in found.findings if isinstance(one, OtherBody)] == [OtherBody(tracks.labels[10 - arm :])]
    assert found.status is Status.NOT_CHECKED
    assert found.rejected[:, 10 - arm :].all()
    error = found.position[0] - CENTRE
    assert error @ np.linalg.solve(found.covariance[0], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("seed", range(3))
def test_of_two_bodies_that_turn_the_one_that_is_seen_most_is_estimated(seed):
    rng = np.random.default_rng(10 + seed)
    few, many = tumbling(rng, 4), tumbling(rng, 6, CENTRE + np.array([4.0, 1.0, 2.0]), rate=0.04)
    tracks = seen_of(rng, few, many)
    assert [group.tolist() for group in bodies_beside(tracks.position, tracks.seen)] == [[0, 1, 2, 3]]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("deviations", [(0.01, 0.01), (0.005, 0.3)])
def test_noise_makes_no_second_body(seed, deviations):
    """Two faces that turn about the line of sight, each rigid, between which depths are noisy; and gaps at random."""
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(0.05 * TIME[:, None] * np.array([0.0, 0, 1])).as_matrix()
    points = np.concatenate([np.c_[rng.uniform(-1, 1, (4, 2)), np.full(4, depth)] for depth in (-0.8, 0.8)])
    across, along = deviations
    position = CENTRE + points @ np.swapaxes(R, 1, 2) + np.array([across, across, along]) * rng.normal(size=(200, 8, 3))
    assert bodies_beside(position, rng.random((200, 8)) < 0.6) == []
    assert bodies_beside(tumbling(rng, 8) + across * rng.normal(size=(200, 8, 3)), np.ones((200, 8), dtype=bool)) == []


@pytest.mark.parametrize("seed", range(5))
def test_labels_of_several_points_are_no_second_body(seed):
    """A tracker that gives its labels anew, three times: distances jump, of all of them."""
    rng = np.random.default_rng(seed)
    position = tumbling(rng, 24).reshape(200, 3, 8, 3)
    given = np.concatenate([position[66 * part : 66 * part + 68, part] for part in range(3)])[:200]
    assert bodies_beside(given + NOISE * rng.normal(size=given.shape), np.ones((200, 8), dtype=bool)) == []


def test_what_bends_a_little_is_one_body():
    """Half of the features sway by 3 cm, three times the noise, on a body of 1.5 m."""
    rng = np.random.default_rng(0)
    position = tumbling(rng, 8)
    position[:, 4:] += 0.03 * np.sin(0.3 * TIME)[:, None, None] * (position[:, 4:] - position[:, :1])
    assert bodies_beside(position + NOISE * rng.normal(size=position.shape), np.ones((200, 8), dtype=bool)) == []
