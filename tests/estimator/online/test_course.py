"""The online estimate of tracks that are there already is what the filter tells frame by frame."""

import numpy as np
import pytest

from baryscope.estimator.online import OnlineEstimator, OnlineStatus
from baryscope.estimator.online.core import MOST_FEATURES
from baryscope.estimator.online.course import course_of, mean_pushes, seen_at_once
from baryscope.estimator.thrust import KnownAcceleration
from baryscope.models.errors import InputError
from synthetic import ENVISAT, attitude, box_features

TIME = np.arange(200.0)
SIGMA = 0.005


def frames(seed=3):
    rng = np.random.default_rng(seed)
    R = attitude(ENVISAT, np.array([0.02, 0.03, 0.05]), TIME)
    path = np.array([8.0, -18.0, 6.0]) + np.array([0.01, 0.005, -0.002]) * TIME[:, None]
    position = path[:, None] + box_features(6, (2, 2, 3), 1) @ np.swapaxes(R, 1, 2)
    position += SIGMA * rng.normal(size=position.shape)
    position[:3] = np.nan  # nothing yet: it waits
    return path, position


def test_it_is_what_the_filter_tells():
    path, position = frames()
    found = course_of(OnlineEstimator(SIGMA), TIME, position)
    filter = OnlineEstimator(SIGMA)
    for k, time in enumerate(TIME.tolist()):
        state = filter.update(time, position[k])
        waits = state.status is OnlineStatus.WAITING
        np.testing.assert_array_equal(found.position[k], np.full(3, np.nan) if waits else state.position)
        assert found.tracking[k] == (state.status is OnlineStatus.TRACKING)
        if not waits:
            np.testing.assert_array_equal(found.covariance[k], state.covariance[:3, :3])
    assert np.isnan(found.position[:3]).all()
    assert found.tracking[-1]
    assert found.tumble[-1]
    assert not np.diff(found.tumble.astype(int)).min() < 0
    error = found.position[-1] - path[-1]
    assert error @ np.linalg.solve(found.covariance[-1], error) < 21.1  # χ² of 3, p = 1e-4


def test_of_many_features_the_first_are_seen():
    position = np.zeros((2, MOST_FEATURES + 3, 3))
    position[1, :2] = np.nan
    seen = seen_at_once(position)
    assert seen.sum(axis=1).tolist() == [MOST_FEATURES, MOST_FEATURES]
    assert not seen[1, :2].any()
    assert not seen[0, MOST_FEATURES:].any()


def test_a_gap_that_the_filter_refuses_is_said():
    _, position = frames()
    time = TIME.copy()
    time[100:] += 100_000.0
    with pytest.raises(InputError, match="longest_gap"):
        course_of(OnlineEstimator(SIGMA), time, position)


def test_pushes_are_means_since_the_frame_before():
    """A push from 1.5 to 3 s, of frames at whole seconds: half of one step and all of the next."""
    log = KnownAcceleration([0.0, 1.5, 3.0], [[0, 0, 0], [2.0, 0, 0], [0, 0, 0]])
    found = mean_pushes(log, np.arange(5.0), None)
    np.testing.assert_allclose(found[:, 0], [0.0, 0.0, 1.0, 2.0, 0.0], atol=1e-15)
    assert not found[:, 1:].any()
