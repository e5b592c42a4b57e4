"""Steps that lead uphill are seen and halved; a body that a path has lost is brought back."""

from dataclasses import replace

import numpy as np
import pytest

from baryscope.estimator.adjustment.observations import Observations
from baryscope.estimator.paths.path import Polynomial
from baryscope.estimator.pivot.free_attitudes import StepStart, linearised
from baryscope.estimator.pivot.lost_bodies import brought_back_bodies
from baryscope.estimator.registration.body import Body
from free_paths import FEATURES, at_rest, turning
from synthetic import make_case

FRAMES, NOISE = 200, 0.01


def problem_at(x, offset=0.0, seed=1):
    """The problem of a body at rest, linearised about a place that is off by x (3,), and points off by offset, m."""
    time, R = turning(FRAMES, 1.0)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=seed)
    observations = Observations(case.tracks.position, np.ones(case.tracks.seen.shape))
    body = Body(np.arange(len(FEATURES)), np.arange(FRAMES), FEATURES + offset, R)
    place = at_rest(time)[0] + x
    sampled = Polynomial(0, 0.0, float(time[-1])).at(time)
    return linearised((body,), observations, sampled, place), observations.weight


@pytest.mark.parametrize("lasting", [1.0, 10.0])
def test_a_step_away_is_worse_and_a_step_back_is_not(lasting):
    right, weight = problem_at(np.zeros(3))
    far, _ = problem_at(np.array([0.5, 0.0, 0.0]))
    none = np.zeros(3)
    assert StepStart(right, weight, NOISE**2, lasting, none).is_worse(far, weight)
    assert not StepStart(far, weight, NOISE**2, lasting, none).is_worse(right, weight)
    assert not StepStart(right, weight, NOISE**2, lasting, none).is_worse(right, weight)


def test_a_step_after_which_nothing_fits_is_worse():
    """Weights of what is far off are 0, not small: without the cost of these it was a step to where nothing is left."""
    right, weight = problem_at(np.zeros(3))
    far, _ = problem_at(np.array([100.0, 0.0, 0.0]))
    rejected = np.zeros_like(weight)
    rejected[0] = weight[0]
    assert StepStart(right, weight, NOISE**2, 1.0, np.zeros(3)).is_worse(replace(far, squares=right.squares), rejected)


def test_a_prior_may_ask_for_a_step_uphill():
    """What the prior of x gains counts as much as what the observations lose."""
    right, weight = problem_at(np.zeros(3))
    near, _ = problem_at(-0.01 * at_rest(np.zeros(1))[0])
    assert StepStart(right, weight, NOISE**2, 1.0, np.zeros(3)).is_worse(near, weight)
    assert not StepStart(right, weight, NOISE**2, 1.0, np.full(3, 1e6)).is_worse(near, weight)


def test_halfway_is_the_mean_of_places_and_points():
    right, weight = problem_at(np.zeros(3))
    far, _ = problem_at(np.array([2.0, 0.0, -4.0]), offset=1.0)
    (body,), x = StepStart(right, weight, NOISE**2, 1.0, np.zeros(3)).halfway(far.bodies, far.x)
    np.testing.assert_allclose(x, right.x + np.array([1.0, 0.0, -2.0]))
    np.testing.assert_allclose(body.points, FEATURES + 0.5)
    np.testing.assert_array_equal(body.attitude, right.bodies[0].attitude)


def test_a_body_that_the_path_has_lost_is_brought_back():
    """All of the second body is rejected, its points are metres off and its attitudes turned: it starts anew there."""
    time, R = turning(FRAMES, 1.0)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=3)
    first, second = np.arange(0, 150), np.arange(150, FRAMES)
    features, shape = np.arange(len(FEATURES)), FEATURES - FEATURES.mean(axis=0)
    bodies = tuple(Body(features, frames, shape, R[frames]) for frames in (first, second))
    measured = Observations(case.tracks.position, np.ones(case.tracks.seen.shape))
    lost = replace(bodies[1], points=FEATURES + np.array([5.0, 0.0, 0.0]), attitude=np.swapaxes(R[second], 1, 2))
    weight = np.ones_like(measured.weight)
    assert brought_back_bodies(bodies, weight, bodies, bodies, measured, at_rest(time)) is None
    weight[second] = 1e-9
    found = brought_back_bodies((bodies[0], lost), weight, bodies, bodies, measured, at_rest(time))
    assert found is not None
    (same, back), weights = found
    assert same is bodies[0]
    np.testing.assert_array_equal(weights, measured.weight)
    np.testing.assert_array_equal(back.attitude, R[second])
    # The median of 50 frames of eight features.
    np.testing.assert_allclose(back.points, FEATURES, atol=5 * 1.25 * NOISE / np.sqrt(400))


def test_frames_that_joined_a_lost_body_leave_it_when_it_is_brought_back():
    """Two features of it gave them an attitude about a wrong path, and the start has none: its frames are those of the
    start, and what else was seen of it is not used, as before.
    """
    time, R = turning(FRAMES, 1.0)
    case = make_case(time, R, at_rest(time), FEATURES, noise=NOISE, seed=4)
    began, joined = np.arange(150, FRAMES), np.arange(140, 150)
    features, shape = np.arange(len(FEATURES)), FEATURES - FEATURES.mean(axis=0)
    start = Body(features, began, shape, R[began])
    both = np.concatenate([joined, began])
    lost = Body(features, both, FEATURES + np.array([5.0, 0.0, 0.0]), np.swapaxes(R[both], 1, 2))
    first = np.zeros(case.tracks.seen.shape)
    first[began] = 1.0
    measured = Observations(case.tracks.position, first)
    weight = first.copy()
    weight[both] = 1e-9
    found = brought_back_bodies((lost,), weight, (start,), (start,), measured, at_rest(time))
    assert found is not None
    (back,), weights = found
    np.testing.assert_array_equal(back.frames, began)
    np.testing.assert_array_equal(back.attitude, R[began])
    np.testing.assert_array_equal(weights, first)
    # The median of 50 frames of eight features.
    np.testing.assert_allclose(back.points, FEATURES, atol=5 * 1.25 * NOISE / np.sqrt(400))
