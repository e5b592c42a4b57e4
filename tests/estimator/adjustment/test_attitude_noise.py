"""Attitudes of a body, from displaced points of a rotation by scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.adjustment.attitude_noise import departures_of, medians_of, strays
from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.registration.body import Body

NOISE = 0.01
POINTS = np.array([[0.5, 0.1, 0.0], [-0.4, 0.6, 0.2], [0.1, -0.5, 0.6], [-0.2, -0.2, -0.7]])


EVERY_SECOND = np.arange(400.0)  # s


def seen(step, displaced, by, seed=0, time=EVERY_SECOND):
    """A body of four points turning by `step` rad/s, of which one is displaced in some frames, and its tracks."""
    rng, count = np.random.default_rng(seed), len(time)
    turn = Rotation.from_rotvec(np.outer(0.1 * step * time, [0, 1.0, 0]))
    turn = turn * Rotation.from_rotvec(np.outer(step * time, [0.6, 0, 0.8]))
    position = POINTS @ np.swapaxes(turn.as_matrix(), 1, 2) + NOISE * rng.normal(size=(count, 4, 3))
    position[displaced, 0] += by * rng.normal(size=(len(displaced), 3))
    attitude = np.array([Rotation.align_vectors(one, POINTS)[0].as_matrix() for one in position])
    body = Body(np.arange(4), np.arange(count), POINTS, attitude)
    return body, Observations(position, np.ones((count, 4)), None)


def of_one(body, observations):
    """The strays of one body."""
    return strays([body], observations, EVERY_SECOND, NOISE**2)[0]


@pytest.mark.parametrize("step", [0.002, 0.02, 0.1, 0.3])
def test_displaced_features_turn_a_body_away_from_its_rotation(step):
    displaced = np.arange(7, 400, 19)
    found = np.nonzero(of_one(*seen(step, displaced, 0.6)))[0]
    assert set(found) <= set(displaced)
    assert len(found) >= 0.9 * len(displaced)  # a displacement towards the centre hardly turns the body


@pytest.mark.parametrize("step", [0.0, 0.02, 0.1, 0.7, 2.5])
def test_no_attitude_strays_where_none_is_displaced(step):
    body, observations = seen(step, np.zeros(0, dtype=int), 0.0)
    assert not of_one(body, observations).any()
    assert not of_one(Body(body.features, body.frames[:5], POINTS, body.attitude[:5]), observations).any()


def test_a_slow_rotation_is_fitted_over_attitudes_that_are_far_apart():
    """A body that is seen in each fifteenth frame only, which turns by a tenth of a degree a frame."""
    displaced = np.arange(30, 400, 75)
    body, observations = seen(0.002, displaced, 2.0)
    few = Body(body.features, body.frames[::15], POINTS, body.attitude[::15])
    found = few.frames[of_one(few, observations)]
    assert set(found) <= set(displaced)
    assert len(found) >= 4


@pytest.mark.parametrize("step", [0.0, 0.02, 0.1])
def test_a_flip_is_found_where_too_few_attitudes_are_near_to_fit_a_rotation(step):
    """After four attitudes near by there is one, turned by 2 rad, and no other for a long time."""
    body, observations = seen(step, np.zeros(0, dtype=int), 0.0)
    frames = np.r_[0:40, 46:50, 55, 120:150]
    attitude = body.attitude[frames]
    few = Body(body.features, frames, POINTS, attitude)
    assert not of_one(few, observations).any()
    turned = Rotation.from_rotvec([2.0, 0.0, 0.0]).as_matrix()
    flipped = Body(body.features, frames, POINTS, np.where((frames == 55)[:, None, None], attitude @ turned, attitude))
    np.testing.assert_array_equal(frames[of_one(flipped, observations)], [55])


def test_where_rotations_are_too_fast_for_their_frames_nothing_is_a_flip():
    body, observations = seen(2.5, np.zeros(0, dtype=int), 0.0)
    frames = np.sort(np.random.default_rng(1).permutation(400)[:80])
    few = Body(body.features, frames, POINTS, body.attitude[frames])
    assert not of_one(few, observations).any()


def test_attitudes_of_a_body_of_few_frames_are_compared_with_those_of_another():
    """Eight frames of 400 are a body with axes of its own: three attitudes are off by half a turn."""
    body, observations = seen(0.02, np.zeros(0, dtype=int), 0.0)
    frames, off = np.arange(20, 400, 50), [1, 4, 6]
    axes = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    attitude = body.attitude[frames] @ axes.T
    attitude[off] = attitude[off] @ Rotation.from_rotvec([0.0, 3.0, 0.0]).as_matrix()
    few = Body(np.arange(3), frames, POINTS[:3] @ axes.T + NOISE, attitude)
    rest = np.delete(np.arange(400), frames)
    many = Body(body.features, rest, POINTS, body.attitude[rest])
    of_few, of_many = strays([few, many], observations, EVERY_SECOND, NOISE**2)
    assert list(np.nonzero(of_few)[0]) == off
    assert not of_many.any()
    other = Body(few.features, frames, POINTS[[1, 0, 3]] @ axes.T, attitude)  # not the same points
    assert not any(found.any() for found in strays([other, many], observations, EVERY_SECOND, NOISE**2))


def mean_square(body, observations, time, variance):
    """That of the departures over what is expected; of 400 values of χ²₃ over 3 it has the deviation √(2/1200), and
    neighbours share some of it.
    """
    found = departures_of(body, observations, time, variance)
    return float(found.squares[found.tested].mean()) / 3


def test_departures_are_as_great_as_the_errors_are():
    body, observations = seen(0.02, np.zeros(0, dtype=int), 0.0)
    assert mean_square(body, observations, EVERY_SECOND, NOISE**2) == pytest.approx(1.0, abs=0.2)
    assert mean_square(body, observations, EVERY_SECOND, NOISE**2 / 2) == pytest.approx(2.0, abs=0.4)


def test_of_a_dozen_attitudes_none_is_tested():
    body, observations = seen(0.02, np.zeros(0, dtype=int), 0.0)
    few = Body(body.features, body.frames[:12], POINTS, body.attitude[:12])
    found = departures_of(few, observations, EVERY_SECOND, NOISE**2)
    assert found.turn.shape == (12, 3)
    assert not found.tested.any()


@pytest.mark.parametrize("step", [0.02, 0.1])
def test_attitudes_are_compared_in_time_where_frames_come_in_bursts(step):
    """Bursts of 20 frames, a second apart, with half a minute and more between them, in which the body turns on."""
    pauses = np.repeat(np.random.default_rng(2).uniform(30.0, 90.0, 20), 20)
    time = np.arange(400.0) + np.cumsum(np.where(np.arange(400) % 20 == 0, pauses, 0.0))
    body, observations = seen(step, np.zeros(0, dtype=int), 0.0, time=time)
    assert not strays([body], observations, time, NOISE**2)[0].any()
    assert mean_square(body, observations, time, NOISE**2) == pytest.approx(1.0, abs=0.2)  # as without bursts


def test_medians_of_some_are_numpys_without_the_others():
    rng = np.random.default_rng(2)
    values, used = rng.exponential(size=(50, 9)), rng.random((50, 9)) < 0.7
    values[3, 2], used[3, 2], used[4], used[4, 5] = np.nan, True, False, True
    expected = np.nanmedian(np.where(used, values, np.nan), axis=1)
    np.testing.assert_array_equal(medians_of(values, used), expected)
    assert np.isnan(medians_of(values[:1], np.zeros((1, 9), dtype=bool))).all()
