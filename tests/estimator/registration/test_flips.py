"""Attitudes turned over at random, in a steady rotation from scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from baryscope.estimator.registration.flips import same_sense, steady


def rotation(count, step, noise, seed=0):
    turns = Rotation.from_rotvec(np.outer(step * np.arange(count), [0.6, 0, 0.8]))
    slow = Rotation.from_rotvec(np.outer(0.1 * step * np.arange(count), [0, 1.0, 0]))
    return slow * turns * Rotation.from_rotvec(noise * np.random.default_rng(seed).normal(size=(count, 3)))


@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("step", [0.01, 0.5])
def test_flipped_attitudes_are_found_and_no_others(noise, step):
    true = rotation(300, step, noise)
    rng = np.random.default_rng(1)
    flipped = np.sort(rng.choice(np.arange(2, 298), 12, replace=False))
    attitude = true.as_matrix()
    attitude[flipped] = (true[flipped] * Rotation.from_rotvec(np.pi * np.eye(3)[rng.integers(0, 3, 12)])).as_matrix()
    kept = steady(np.arange(300), attitude)
    np.testing.assert_array_equal(np.nonzero(~kept)[0], flipped)
    assert steady(np.arange(300), true.as_matrix()).all()


@pytest.mark.parametrize("step", [0.0, 1.0, 2.5])
def test_rotations_that_cannot_be_followed_are_left_alone(step):
    assert steady(np.arange(200), rotation(200, step, 0.3).as_matrix()).all()
    assert steady(np.arange(100), Rotation.random(100, random_state=0).as_matrix()).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("runs", [[(100, 180)], [(0, 90)], [(210, 300)], [(20, 50), (120, 190)], [(150, 155)]], ids=str)
def test_axes_that_are_turned_for_a_while_are_found(runs, noise, seed):
    """Half a turn about one axis of the body; the rotation is lost in a gap of ten frames, where a new chain begins."""
    true, frames = rotation(300, 0.05, noise, seed), np.arange(300)
    frames = frames + 10 * (frames >= 110) if runs[0][0] < 100 else frames
    attitude, turned = true.as_matrix(), np.zeros(300, dtype=bool)
    for begin, end in runs:
        turned[begin:end] = True
    attitude[turned] = attitude[turned] @ Rotation.from_rotvec([np.pi, 0, 0]).as_matrix()
    attitude[60] = attitude[60] @ Rotation.from_rotvec([0, 2.0, 0]).as_matrix()  # a flip of a single frame besides
    expected = turned.copy()
    if runs == [(0, 90)]:  # the longer part of its chain
        expected[:110] = ~turned[:110]
    expected[60] = True
    np.testing.assert_array_equal(~steady(frames, attitude), expected)


def test_what_happens_in_a_gap_of_time_turns_no_axes():
    """A pure spin goes on in a blackout whose frames are not there: the attitudes differ by a turn about its axis."""
    spin = Rotation.from_rotvec(np.outer(0.05 * np.arange(200), [0.6, 0, 0.8]))
    time = np.arange(200.0)
    later = np.delete(time, np.arange(80, 130))
    assert steady(later, spin.as_matrix()[later.astype(int)]).all()
    assert not steady(np.arange(150.0), spin.as_matrix()[later.astype(int)]).all()


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_lines_that_point_the_other_way_than_those_about_them_are_found(noise):
    """A fifth of the frames; the line goes on in a gap, after which the way that most of it point is the right one."""
    along = rotation(300, 0.05, noise).apply([0.6, 0.8, 0.0])
    reversed_ = np.random.default_rng(2).random(300) < 0.2
    along[reversed_] *= -1
    kept, sure = same_sense(np.arange(300) + 40.0 * (np.arange(300) >= 110), along)
    np.testing.assert_array_equal(kept, ~reversed_)
    assert sure.all()


@pytest.mark.parametrize("step", [1.0, 2.0, 2.8])
def test_lines_that_cannot_be_followed_are_left_alone(step):
    kept, sure = same_sense(np.arange(200.0), rotation(200, step, 0.05).apply([0.3, 0.9, 0.3]))
    assert kept.all()
    assert not sure.any()
