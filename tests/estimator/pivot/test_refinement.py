"""Steps that come to rest late: where the weights of a feature that moves settle slowly."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from baryscope.estimator.findings import MovingFeatures
from baryscope.estimator.methods import estimate
from baryscope.estimator.options import PathOptions
from baryscope.estimator.pivot.method import solve_pivot
from baryscope.estimator.pivot.refinement import LONGEST, MAX_ROUNDS
from baryscope.estimator.result import Status
from baryscope.estimator.tracks import FeatureTracks
from baryscope.study.population.judging import of_estimate, prepared, wrong

NOISE = 6.4e-4


def loose_marker():
    """Five markers about a joint that is carried along for 15 s, of which one swings by ten deviations, and the joint
    (n, 3), m.
    """
    rng, time = np.random.default_rng(11), np.arange(200) / 13
    turn = sum(
        0.35 * np.sin(2 * np.pi * time[:, None] / rng.uniform(1.5, 9) + rng.uniform(0, 6.28, 3)) * rng.normal(size=3)
        for _ in range(4)
    )
    points = np.tile(0.03 * rng.normal(size=(5, 3)) + [0.1, 0.1, 0.05], (len(time), 1, 1))
    points[:, 2] += 6e-3 * np.sin(2 * np.pi * time / 6)[:, None] * [0.6, 0, 0.8]
    joint = np.array([1.0, 0.0, 1.0]) + np.outer(time, [0.03, 0, 0.01])
    place = joint[:, None] + points @ np.swapaxes(Rotation.from_rotvec(turn).as_matrix(), 1, 2)
    return FeatureTracks(time, place + NOISE * rng.normal(size=place.shape), tuple("abcde")), joint


def test_rounds_are_added_where_steps_are_near_their_end():
    """Whose weights are at rest after the rounds that there are; the residuals then tell which marker moves."""
    tracks, joint = loose_marker()
    solved = solve_pivot(tracks, None, PathOptions(sigma=NOISE))
    assert solved.converged
    assert MAX_ROUNDS < solved.rounds < LONGEST
    found = estimate(tracks, options=PathOptions(sigma=NOISE))
    assert found.status is Status.GOOD
    assert [one.labels for one in found.findings if isinstance(one, MovingFeatures)] == [("c",)]
    error = found.position[100] - joint[100]
    assert error @ np.linalg.solve(found.covariance[100], error) < chi2.isf(1e-4, 3)


@pytest.mark.parametrize("told", [True, False])
def test_noise_that_frames_share_is_looked_for_where_steps_go_round(told):
    """A camera that shakes by 2 mm, and a body that turns nearly about an axis, along which its place is hardly told.

    A path that follows the shaking has a place metres away that one without process noise has not: steps went from the
    one to the other for ever, as what frames share was looked for only where they had come to rest.
    """
    case, sample, _ = prepared(51, 1, "third")
    found = estimate(sample.tracks, orbit=case.orbit if told else None)
    assert found.converged
    line = of_estimate(found, case.path)
    assert not wrong(line)
    assert line["rmse"] < 0.1
